"""The picture of a proof of cutter compensation: contour and cutter's path, and the edge's deviation along the path."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rds.nc.compensation.moves import XY
from rds.nc.compensation.proof_pieces import CONTOUR, ENTRY, EXIT, LEAD_IN, LEAD_OUT, MM, RAPID

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rds.nc.compensation.proof import Part, Proof, StretchProof
    from rds.nc.compensation.proof_geometry import Curve

# Okabe and Ito, "Color Universal Design" (2008); each role has a line style of its own as well
_BLUE, _ORANGE, _VERMILLION, _GREY, _BLACK = "#0072B2", "#E69F00", "#D55E00", "#8A8A8A", "#000000"
_STYLES = {
    CONTOUR: ("centre of the cutter", _BLUE, "-"),
    ENTRY: ("entry, exit", _ORANGE, "--"),
    LEAD_IN: ("lead-in, lead-out", _ORANGE, "-."),
    RAPID: ("rapid (not judged)", _GREY, ":"),
}
_SAME = {EXIT: ENTRY, LEAD_OUT: LEAD_IN}
_CHORD = 0.02  # rad; arcs are drawn in steps of this
_SCALES = ((1.0, "mm"), (1e3, "µm"), (1e6, "nm"))


def plot(proof: Proof, number: int = 0) -> Figure:
    """Left, the plane: programmed contour, path of the cutter's centre, the cutter at some places, gouges. Right, over
    the path's length, the deviation of the cutter's edge from the contour: the whole path, below it the contour alone.

    A matplotlib Figure of its own, without pyplot and display. Lengths in mm. `number`: which stretch.
    """
    from matplotlib.figure import Figure

    stretch = proof.stretches[number]
    figure = Figure(figsize=(11.5, 5.6), dpi=128, layout="constrained", facecolor="white")
    places = figure.subplot_mosaic([["plane", "all"], ["plane", "contour"]], width_ratios=[1.15, 1.0])
    _plane(places["plane"], stretch)
    _all(places["all"], stretch)
    _contour(places["contour"], stretch)
    places["contour"].sharex(places["all"])
    figure.suptitle(_title(proof, stretch), x=0.01, ha="left", fontsize="medium")
    for axes in places.values():
        axes.grid(True, color="#E2E2E2", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    return figure


def _title(proof: Proof, stretch: StretchProof) -> str:
    first, last = stretch.lines
    side = "left" if stretch.stretch.side > 0 else "right"
    gouges = stretch.gouges()
    verdict = "no gouge"
    if gouges:
        deepest = -min(part.least for part in gouges)
        where = f"{len(gouges)} moves" if len(gouges) > 1 else "one move"
        verdict = f"gouges in {where}, {_length(deepest)} deep at most"
    name = f"{proof.name}, lines" if proof.name else "Lines"
    return (
        f"{name} {first} to {last}: cutter of radius {stretch.radius:g} mm, {side} of the contour.  Edge to contour:"
        f" {_length(stretch.max_deviation)} at most, {verdict}"
    )


def _length(mm: float) -> str:
    if abs(mm) < 1e-6:
        return "0 (to 1 nm)"
    factor, unit = _scale(mm)
    return f"{mm * factor:.3g} {unit}"


def _scale(mm: float) -> tuple[float, str]:
    return next((s for s in _SCALES if abs(mm) * s[0] >= 0.1), _SCALES[-1])


def _points(curve: Curve, stretch: StretchProof) -> tuple[np.ndarray, np.ndarray]:
    """Horizontal and vertical values, mm: X and Y, or Z and X."""
    steps = max(1, math.ceil(abs(curve.sweep) / _CHORD))
    u, v = curve.at(np.linspace(0, 1, steps + 1)).T * MM[stretch.stretch.units]
    return u, v


def _style(role: str) -> tuple[str, str, str]:
    return _STYLES[_SAME.get(role, role)]


def _plane(axes: Axes, stretch: StretchProof) -> None:
    label: str | None = "programmed contour"
    for chain in stretch.chains:
        for curve in chain.contour_curves:
            axes.plot(*_points(curve, stretch), color=_BLACK, linewidth=1.8, label=label, zorder=3)
            label = None
    said = set()
    for part in stretch.parts:
        name, colour, line = _style(part.role)
        width = 1.4 if part.role == CONTOUR else 1.2
        text = None if name in said else name
        axes.plot(*_points(part.curve, stretch), color=colour, linestyle=line, linewidth=width, label=text, zorder=4)
        said.add(name)
    _cutters(axes, stretch)
    for number, part in enumerate(stretch.gouges()):
        u, v = part.deepest_at * MM[stretch.stretch.units]
        axes.plot(
            *(u, v),
            "x",
            color=_VERMILLION,
            markersize=9,
            markeredgewidth=2,
            zorder=6,
            label=None if number else "gouge",
        )
    names = ("X", "Y") if stretch.stretch.plane == XY else ("Z", "X")
    axes.set(xlabel=f"{names[0]} [mm]", ylabel=f"{names[1]} [mm]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False, fontsize="small")


def _cutters(axes: Axes, stretch: StretchProof) -> None:
    """Outlines of the cutter: where it begins, where it comes to the contour, goes deepest, and ends."""
    from matplotlib.patches import Circle

    if not stretch.parts:
        return
    unit = MM[stretch.stretch.units]
    parts = stretch.of(CONTOUR) or list(stretch.parts)
    worst = min(parts, key=lambda part: part.least)
    centres = [
        stretch.parts[0].curve.at(0.0),
        parts[0].curve.at(0.0),
        worst.deepest_at,
        stretch.parts[-1].curve.at(1.0),
    ]
    for number, centre in enumerate(centres):
        axes.add_patch(
            Circle(
                tuple(centre * unit),
                stretch.radius,
                facecolor=_BLUE,
                alpha=0.13,
                edgecolor=_BLUE,
                linewidth=0.8,
                zorder=2,
                label=None if number else "cutter",
            )
        )


def _curves(axes: Axes, parts: list[Part], factor: float) -> None:
    for part in parts:
        _, colour, line = _style(part.role)
        axes.plot(part.distance, part.deviation * factor, color=colour, linestyle=line, linewidth=1.4)


def _all(axes: Axes, stretch: StretchProof) -> None:
    parts = [part for part in stretch.parts if part.role != RAPID]
    _curves(axes, parts, 1.0)
    _mark_gouges(axes, stretch.gouges(), 1.0)
    axes.set_ylabel("edge to contour [mm]")
    axes.set_title("Whole path: + clear of the contour, − beyond it", loc="left", fontsize="small")


def _contour(axes: Axes, stretch: StretchProof) -> None:
    parts = stretch.of(CONTOUR)
    factor, unit = _scale(stretch.max_deviation)
    _curves(axes, parts, factor)
    _mark_gouges(axes, [part for part in stretch.gouges() if part.role == CONTOUR], factor)
    most = max(stretch.max_deviation * factor * 1.15, 1.0 if unit == "nm" else 0.0)
    axes.set_ylim(-most, most)
    axes.set(xlabel="length of the path of the cutter's centre [mm]", ylabel=f"edge to contour [{unit}]")
    text = "Contour alone"
    if stretch.uncut > 1e-6:
        text += f"; inside corners keep up to {_length(stretch.uncut)}"
    axes.set_title(text, loc="left", fontsize="small")


def _mark_gouges(axes: Axes, parts: list[Part], factor: float) -> None:
    for part in parts:
        worst = int(part.deviation.argmin())
        axes.plot(
            part.distance[worst],
            part.deviation[worst] * factor,
            "x",
            color=_VERMILLION,
            markersize=8,
            markeredgewidth=2,
        )
