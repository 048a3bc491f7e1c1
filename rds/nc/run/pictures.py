"""Pictures of a program's run: the measured path with its contour error, and the errors along the program."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.figure import BLACK, CYCLE, GREY, ORANGE, SKY, VERMILLION, Picture, common_legend, dress, legend
from rds.modes.loop.execution import State
from rds.modes.loop.program import InterpolatedProgram
from rds.nc.path_block import PathBlock
from rds.nc.run.judge import worst_lines
from rds.nc.run.prepare import Prepared
from rds.nc.trace import Trace
from rds.results import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINEAR, ROTARY = "XYZ", "ABC"
_POINTS = 6000  # of a curve in a picture
_VIEWS = (("XY", "X", "Y"), ("ZX", "X", "Z"), ("YZ", "Y", "Z"))
_NAMED = 3  # of the worst lines
_MARKERS = ("o", "s", "D")
_WORST: dict[str, Any] = {"markersize": 9, "markerfacecolor": "none", "color": VERMILLION, "zorder": 3}
_CUT: dict[str, Any] = {"color": GREY, "linewidth": 0.8, "zorder": 1, "label": "cut, as planned"}
_COMMANDED: dict[str, Any] = {"color": ORANGE, "linewidth": 1.0, "linestyle": (0, (5, 2)), "zorder": 2.2}
_PROGRAMMED: dict[str, Any] = {"color": BLACK, "linewidth": 0.8, "linestyle": (0, (1, 1.5)), "zorder": 2.1}
_COLOURS: dict[str, Any] = {"cmap": "viridis", "linewidths": 0, "zorder": 2}
_LEAST_ERROR = 0.01  # µm, at the end of the scale: less is rounding
_RAPID: dict[str, Any] = {
    "color": SKY,
    "linewidth": 1.2,
    "linestyle": (0, (5, 3)),
    "zorder": 1,
    "label": "rapid, as planned",
}


def path(result: Result, prepared: Prepared) -> Picture:
    """The path from up to three sides, and over time of each axis that no side shows: a rotary one, or the only one.

    Rapids are dashed as planned, cuts as measured in the colour of their contour error. The worst lines are marked, and
    named in the legend. Of a run that a path leads, the path as programmed is drawn, too, and what was commanded.
    """
    axes = prepared.program.axes
    views = [view for view in _VIEWS if view[1] in axes and view[2] in axes]
    alone = [name for name in axes if not any(name in view[1:] for view in views)]
    contour = any(name in LINEAR for name in axes)
    error = result["contour_error"] * 1e3
    planned, rapid, row = _planned(result, prepared)
    measured_at = {name: result[f"{name}_measured"] for name in axes}
    if prepared.tip is not None and not isinstance(prepared.program, InterpolatedProgram):
        length = prepared.path["tool_length"][prepared.segment]
        planned = planned.copy()
        for i, values in prepared.tip.of_axes(axes, [planned[:, k] for k in range(len(axes))], length).items():
            planned[:, i] = values
        found = prepared.tip.of_axes(axes, list(measured_at.values()), length[row])
        measured_at |= {axes[i]: values for i, values in found.items()}
    at = _thinned(error, np.flatnonzero(~rapid[row] & (result["program_state"] != State.HOME)))
    count = len(views) + len(alone)
    across = 2 if len(views) > 1 else 1
    rows = -(-count // across)
    picture = Picture(8.0 if across == 2 and rows == 2 else 3.8 * rows if across == 2 else max(2.8 * rows, 4.6))
    places = picture.subplots(rows, across, squeeze=False).ravel()
    edges = _edges(len(rapid))
    of = result.meta["program"].get("counted_in", "line")
    worst = [
        (f"{of} {line}: {value:.1f} µm", int(np.searchsorted(result["time"], when)))
        for line, value, when in (worst_lines(result, error, _NAMED) if contour else ())
    ]
    drawn: Any = None
    interpolated = isinstance(prepared.program, InterpolatedProgram)
    styles = [(False, _COMMANDED | {"label": "commanded"})] if interpolated else [(False, _CUT), (True, _RAPID)]
    programmed = _programmed(prepared) if "path_error" in result else None
    most = max(float(error[at].max(initial=0.0)), _LEAST_ERROR)

    def draw(place: Axes, wanted: tuple[np.ndarray, np.ndarray], measured: tuple[np.ndarray, np.ndarray]) -> Any:
        for kind, style in styles:
            shown = rapid[edges] == kind
            place.plot(np.where(shown, wanted[0], np.nan), np.where(shown, wanted[1], np.nan), **style)
        x, y = measured
        for (label, k), marker in zip(worst, _MARKERS, strict=False):
            place.plot(x[k], y[k], linestyle="none", marker=marker, label=label, **_WORST)
        if not contour:
            place.plot(x, y, color=BLACK, linewidth=0.9, zorder=2, label="measured")
            return None
        return place.scatter(x[at], y[at], c=error[at], vmin=0.0, vmax=most, s=5.0, **_COLOURS)

    for place, (title, across_name, up) in zip(places, views, strict=False):
        names = (across_name, up)
        u, v = (planned[edges, axes.index(name)] for name in names)
        x, y = (measured_at[name] for name in names)
        drawn = draw(place, (u, v), (x, y))
        if programmed is not None:
            place.plot(*(programmed[:, LINEAR.index(name)] for name in names), label="programmed", **_PROGRAMMED)
        dress(place, f"{up} [mm]", f"{across_name} [mm]")
        place.set_aspect("equal", adjustable="datalim")
        place.set_title(title + ", tool's tip on the work" * (prepared.tip is not None), loc="left", fontsize="medium")
    sent = _sent_at(result, row, edges)
    for place, name in zip(places[len(views) :], alone, strict=False):
        u, v = sent, planned[edges, axes.index(name)]
        drawn = draw(place, (u, v), (result["time"], result[f"{name}_measured"])) or drawn
        dress(place, f"{name} [{result.units[f'{name}_measured']}]")
        place.set_title(f"{name} over time", loc="left", fontsize="medium")
    for place in places[count:]:
        place.set_axis_off()
    if drawn is not None:
        picture.colorbar(drawn, ax=list(places), label="contour error of the cuts [µm]", shrink=0.8)
    handles, texts = places[0].get_legend_handles_labels()
    common_legend(picture, handles, texts, "outside upper left")
    return picture


def _programmed(prepared: Prepared) -> np.ndarray:
    """Points of the programmed path, n × 3 in mm, with nan between its parts; of a tip that moves, the tip's."""
    path = prepared.path if prepared.tip is None else prepared.tip.path
    return np.concatenate(list(Trace.of([PathBlock(path)]).points.values()))


def _planned(result: Result, prepared: Prepared) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples of the path as planned, which of them are rapids, and which of them each row of the result is.

    Of a path that was interpolated while it ran these are its references.
    """
    program = prepared.program
    if isinstance(program, InterpolatedProgram):
        positions = np.column_stack([result[f"{name}_reference"] for name in program.axes])
        return positions, np.zeros(len(result), bool), np.arange(len(result))
    count = len(prepared.segment)
    rapid = prepared.path["rapid"][prepared.segment] if len(prepared.path) else np.zeros(count, bool)
    return program.position, rapid, np.clip(np.ceil(result["program_sample"]).astype(int), 0, count - 1)


def _sent_at(result: Result, row: np.ndarray, planned: np.ndarray) -> np.ndarray:
    """Time at which each of the planned samples was sent, s, by the planned sample of each row; nan: never."""
    reached = np.maximum.accumulate(row)
    time: np.ndarray = result["time"][np.searchsorted(reached, planned).clip(0, len(row) - 1)]
    return np.where(planned <= reached[-1], time, np.nan)


def along(result: Result, prepared: Prepared) -> Picture:
    """Contour error, following errors and feed over time, with the program's lines above."""
    time = result["time"]
    picture = Picture(8.4)
    top, middle, bottom = picture.subplots(3, 1, sharex=True)
    edges = _edges(len(time))
    top.plot(time[edges], _largest(result["contour_error"] * 1e3, edges), color=BLACK, linewidth=1.1, label="measured")
    if "path_error" in result:
        commanded = _largest(result["path_error"] * 1e3, edges)
        top.plot(time[edges], commanded, color=ORANGE, linewidth=1.1, linestyle=(0, (5, 2)), label="commanded")
        top.legend(loc="upper right", frameon=False, fontsize="small")
    dress(top, "off the programmed path [µm]" if "path_error" in result else "contour error [µm]", None)
    for i, name in enumerate(prepared.program.axes):
        unit = result.units[f"{name}_measured"]
        scale, unit = (1e3, "µm") if unit == "mm" else (1.0, unit)
        off = np.abs(result[f"{name}_reference"] - result[f"{name}_measured"]) * scale
        style = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1, 1, 1)))[i % 4]
        values = _largest(off, edges)
        middle.plot(time[edges], values, color=CYCLE[i % 6], linestyle=style, linewidth=1.1, label=f"{name} [{unit}]")
    dress(middle, "|following error|", None)
    legend(middle)
    speeds = [
        (label, _speed(result, found))
        for label, of in (("feed [mm/min]", LINEAR), ("turning [degrees/min]", ROTARY))
        if (found := [name for name in prepared.program.axes if name in of])
    ]
    several = len(speeds) > 1
    for i, (label, speed) in enumerate(speeds):
        style = ("-", (0, (5, 2)))[i]
        shown = label if several else None
        bottom.plot(time[edges], speed[edges], color=CYCLE[i], linestyle=style, linewidth=1.1, label=shown)
    dress(bottom, "speed" if several else speeds[0][0])
    _mark_waits(bottom, result)
    _mark_lines(top, result)
    return picture


def _mark_waits(axes: Axes, result: Result) -> None:
    """Grey where the program waits or is held, orange on the way home."""
    state = result["program_state"].astype(int)
    starts = np.flatnonzero(np.diff(state, prepend=-1))
    ends = [*starts[1:], len(state) - 1]
    named: set[str] = set()
    for start, end in list(zip(starts, ends, strict=True))[:500]:
        if state[start] != State.RUNS:
            homes = state[start] == State.HOME
            label = "moves home" if homes else "waits, dwells or is held"
            axes.axvspan(
                *result["time"][[start, end]],
                color=ORANGE if homes else GREY,
                alpha=0.25,
                linewidth=0,
                label=None if label in named else label,
            )
            named.add(label)
    legend(axes)


def _mark_lines(axes: Axes, result: Result) -> None:
    """Program lines on top, as many as can be read."""
    line, time = result["program_line"].astype(int), result["time"]
    starts = np.flatnonzero(np.diff(line, prepend=line[0] - 1))
    shown: list[int] = []
    least = (time[-1] - time[0]) / 24
    for k in starts:
        if not shown or time[k] - time[shown[-1]] >= least:
            shown.append(int(k))
    above = axes.secondary_xaxis("top")
    above.set_xticks([time[k] for k in shown], [str(line[k]) for k in shown], fontsize="x-small")
    above.set_xlabel("program line", fontsize="small")


def _edges(count: int) -> np.ndarray:
    """Where the parts of a long curve begin of which the largest value is drawn."""
    return np.arange(0, count, max(1, count // _POINTS))


def _largest(values: np.ndarray, edges: np.ndarray) -> np.ndarray:
    largest: np.ndarray = np.maximum.reduceat(values, edges)
    return largest


def _thinned(error: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Those of the samples `shown` to draw, among them the worst; the worst last, on top."""
    if not len(shown):
        return shown
    worst = np.argsort(error[shown])[-50:]
    both = shown[np.union1d(_edges(len(shown)), worst)]
    ordered: np.ndarray = both[np.argsort(error[both])]
    return ordered


def _speed(result: Result, axes: list[str]) -> np.ndarray:
    """Speed of the reference in some axes together, per minute."""
    squares: np.ndarray = sum((result[f"{name}_reference_velocity"] ** 2 for name in axes), np.zeros(len(result)))
    speed: np.ndarray = 60.0 * np.sqrt(squares)
    return speed
