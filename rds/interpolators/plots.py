"""Pictures of an interpolation: motion of the axes, path, errors."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from rds.core.figure import BLUE, CYCLE, GREY, VERMILLION, Picture, dress, legend

if TYPE_CHECKING:
    from rds.interpolators.reference_word import Steps
    from rds.interpolators.result import Interpolation

_ROUNDING = 1e-6  # mm: a smaller error is rounding, and is drawn as the zero that it is
_STYLES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1)))


def pictures(done: Interpolation) -> dict[str, Picture]:
    """All that there is to draw, by name."""
    return {name: picture(done, name) for name in names_of(done)}


def names_of(done: Interpolation) -> list[str]:
    """The names of the pictures that there are of it."""
    names = ["motion", "path", "magnified"] if len(done.axes) > 1 else ["motion"]
    names.append("errors")
    names += ["steps"] if done.worst_steps is not None else []
    return names + (["generation-error"] if done.generation_error is not None else [])


def picture(done: Interpolation, name: str) -> Picture:
    """One of them."""
    if name == "steps":
        assert done.worst_steps is not None
        return steps(done.worst_steps)
    drawn = {"motion": motion, "path": path, "magnified": magnified, "errors": errors}
    return (drawn | {"generation-error": generation_error})[name](done)


def motion(done: Interpolation) -> Picture:
    """Position, velocity and acceleration of each axis over time."""
    return over_time(done.time, done.axes, done.position, done.velocity, done.acceleration_rows)


def over_time(
    time: np.ndarray, names: Sequence[str], position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
) -> Picture:
    """The same of samples (m, axes) in mm, mm/s and mm/s² at `time` (m) in s."""
    picture = Picture(7.5)
    grid = picture.subplots(3, 1, sharex=True)
    quantities = (
        ("position [mm]", position),
        ("velocity [mm/s]", velocity),
        ("acceleration [mm/s²]", acceleration),
    )
    for axes, (name, values) in zip(grid, quantities, strict=True):
        for k, axis in enumerate(names):
            axes.plot(time, values[:, k], color=CYCLE[k], linestyle=_STYLES[k], linewidth=1.3, label=axis)
        dress(axes, name, "time [s]" if axes is grid[-1] else None)
    legend(grid[0], columns=6)
    picture.align_ylabels()
    return picture


def path(done: Interpolation) -> Picture:
    """The path in each plane in which it goes somewhere: programmed, and as interpolated."""
    going = [k for k in range(len(done.axes)) if np.ptp(done.theory[:, k]) > 0.0]
    return in_planes(done.axes, going, _programmed(done), done.position)


def in_planes(names: Sequence[str], going: Sequence[int], programmed: np.ndarray, position: np.ndarray) -> Picture:
    """Points of the programmed path, and samples (rows; mm, one column for each of `names`), in each plane of two of
    the axes `going`.
    """
    going = going or [0]
    planes = list(combinations(going, 2))[:3] or [(going[0], (going[0] + 1) % len(names))]
    picture = Picture(4.8, max(6.0, 4.8 * len(planes)))
    grid = picture.subplots(1, len(planes), squeeze=False)[0]
    for axes, (i, j) in zip(grid, planes, strict=True):
        axes.plot(programmed[:, i], programmed[:, j], color=GREY, linewidth=4.0, alpha=0.45, label="programmed")
        axes.plot(position[:, i], position[:, j], color=BLUE, linewidth=1.1, label="interpolated")
        axes.plot(*position[0, [i, j]], "o", color=BLUE, markersize=6, label="start")
        axes.plot(*position[-1, [i, j]], "s", color=VERMILLION, markersize=6, label="end")
        dress(axes, f"{names[j]} [mm]", f"{names[i]} [mm]")
        axes.set_aspect("equal", adjustable="datalim")
    legend(grid[0])
    return picture


def speed(time: np.ndarray, programmed: np.ndarray, along: np.ndarray, unit: str) -> Picture:
    """The speed `along` the path over time (s), and the programmed feed rate, which is nan where there is none."""
    picture = Picture(3.4)
    axes = picture.subplots()
    axes.plot(time, programmed, color=GREY, linewidth=4.0, alpha=0.45, label="programmed")
    axes.plot(time, along, color=BLUE, linewidth=1.1, label="along the path")
    dress(axes, f"speed [{unit}]")
    axes.set_ylim(bottom=0.0)
    legend(axes)
    return picture


def magnified(done: Interpolation, times: float | None = None) -> Picture:
    """The path in the plane in which it is furthest off, with its distances from the programmed path `times` larger.

    By default as large as fits the picture. Circles are samples; the line goes through the chords' middles too.
    """
    from rds.interpolators.deviation import path_deviations

    middles = (done.position[1:] + done.position[:-1]) / 2.0
    rows = np.empty((2 * len(done.position) - 1, len(done.axes)))
    rows[::2], rows[1::2] = done.position, middles
    segment = np.empty(len(rows), dtype=int)
    segment[::2], segment[1::2] = done.segment, done.segment[1:]
    # a filtered sample may belong to the segment before: both are looked at
    nearest, off = path_deviations(done.segments, rows, np.maximum(segment - 1, 0), segment)
    spread = np.abs(off).max(axis=0) + 1e-6 * np.ptp(done.theory, axis=0)
    i, j = sorted(np.argsort(-spread, kind="stable")[:2].tolist())
    largest = float(np.linalg.norm(off, axis=1).max())
    size = float(np.ptp(nearest[:, [i, j]], axis=0).max())
    scale = times or (float(f"{0.12 * size / largest:.0e}") if largest > _ROUNDING else 1.0)
    shown = nearest + max(scale, 1.0) * off
    picture = Picture(6.0, 8.0)
    axes = picture.subplots()
    programmed = _programmed(done)
    axes.plot(programmed[:, i], programmed[:, j], color=GREY, linewidth=4.0, alpha=0.45, label="programmed")
    axes.plot(shown[:, i], shown[:, j], color=BLUE, linewidth=1.0, label=f"errors {max(scale, 1.0):g} times as large")
    if len(shown) < 800:
        axes.plot(shown[::2, i], shown[::2, j], "o", color=BLUE, markersize=3, label="samples")
    dress(axes, f"{done.axes[j]} [mm]", f"{done.axes[i]} [mm]")
    axes.set_aspect("equal", adjustable="datalim")
    legend(axes)
    return picture


def errors(done: Interpolation) -> Picture:
    """Distance from the programmed path over time: of the samples, and of the middles between them."""
    picture = Picture(3.4)
    axes = picture.subplots()
    scale, unit = _scale(max(done.path_error.max(), done.chord_error.max()))
    axes.plot(done.time, scale * done.chord_error, color=VERMILLION, linewidth=1.1, label="between samples")
    axes.plot(done.time, scale * done.path_error, color=BLUE, linewidth=1.1, linestyle=(0, (5, 2)), label="at samples")
    worst = done.worst_steps
    if worst is not None:
        axes.axhline(scale * worst.blu, color=GREY, linewidth=1.0, linestyle=(0, (1, 1.5)), label="one BLU")
    dress(axes, f"distance from path [{unit}]")
    axes.set_ylim(0.0, max(axes.get_ylim()[1], scale * _ROUNDING))
    legend(axes)
    return picture


def steps(taken: Steps) -> Picture:
    """Corners and middles of the chords of an arc, taken by reference word (as figure 6 of mrm-control)."""
    picture = Picture(3.6)
    axes = picture.subplots()
    scale, unit = _scale(max(taken.radial_error, taken.chord_error))
    k = np.arange(taken.count + 1)
    size = 4.0 if taken.count <= 200 else 0.0
    axes.plot(k, scale * taken.corners, "o-", color=BLUE, markersize=size, linewidth=0.8, label="corners")
    axes.plot(
        k[1:] - 0.5, scale * taken.middles, "s--", color=VERMILLION, markersize=size, linewidth=0.8, label="middles"
    )
    for bound in (-1, 1):
        label = f"one BLU ({taken.blu:g} mm)" if bound > 0 else None
        axes.axhline(bound * scale * taken.blu, color=GREY, linewidth=1.0, linestyle=(0, (1, 1.5)), label=label)
    dress(axes, f"{taken.method}: outside\nthe circle [{unit}]", "step")
    legend(axes)
    return picture


def generation_error(done: Interpolation) -> Picture:
    """Commanded minus theoretical position of each axis, and what it would be without the carried remainder."""
    from rds.interpolators.reference_pulse import generation_error as decoded
    from rds.interpolators.reference_pulse import pulses_without_carry

    assert done.generation_error is not None and done.blu is not None  # who calls has looked
    dropped = decoded(done.theory, pulses_without_carry(done.theory, done.blu), done.blu)
    count = len(done.axes)
    picture = Picture(1.7 * count + 2.4)
    grid = picture.subplots(count + 1, 1, sharex=True)
    for k, (axes, axis) in enumerate(zip(grid, done.axes, strict=False)):
        values = done.generation_error[:, k] / done.blu
        axes.plot(done.time, values, ".", color=CYCLE[k], markersize=1.2, label=f"{axis}, remainder carried")
        for bound in (-1.0, 1.0):
            axes.axhline(
                bound, color=GREY, linewidth=1.0, linestyle=(0, (1, 1.5)), label="one BLU" if bound > 0 else None
            )
        axes.set_ylim(-1.15, 1.15)
        dress(axes, f"{axis} error [BLU]", None)
        legend(axes)
    for k, axis in enumerate(done.axes):
        grid[-1].plot(
            done.time,
            dropped[:, k] / done.blu,
            color=CYCLE[k],
            linestyle=_STYLES[k],
            label=f"{axis}, remainder dropped",
        )
    dress(grid[-1], "error [BLU]")
    legend(grid[-1])
    picture.align_ylabels()
    return picture


def _programmed(done: Interpolation) -> np.ndarray:
    """Points of the programmed path, close enough to draw."""
    from rds.core.types import ArcSegment
    from rds.interpolators.segment import Arc

    pieces = [np.array([done.segments[0].start])]
    for segment in done.segments:
        if isinstance(segment, ArcSegment):
            arc = Arc.of(segment)
            pieces.append(arc.points(np.linspace(0.0, 1.0, 2 + int(abs(arc.sweep) * 60))))
        else:
            pieces.append(np.array([segment.end]))
    return np.concatenate(pieces)


def _scale(largest: float) -> tuple[float, str]:
    return (1.0, "mm") if largest >= 0.1 else (1000.0, "µm")
