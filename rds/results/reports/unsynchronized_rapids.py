"""Rapid moves of which each axis goes at its own largest speed: when each arrives, and how far off the straight line.

Source: dcs-thesis, section 6.5.1 and figure 6.4: the faster axis arrives first, and the tool turns aside. Two axes of
the same speed that move by a and b leave the line by up to |b - a| times the sine of the angle between line and axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.gauges import LINEAR, Readings, Segment, read_gauges
from rds.results.reports.settings import Setting

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "settled": Setting(
        "an axis has arrived where it is as near as this to the farthest it gets", "mm", 0.011, more_than=0
    ),
    "together": Setting("axes that arrive within this time arrive together", "s", 0.05, more_than=0),
}
_STILL = 1e-9  # mm: an axis that does not move


@dataclass(frozen=True)
class Rapid:
    """One rapid of one run: when each axis arrived (s from its begin; nan: it does not move)."""

    run: str
    segment: Segment
    position: np.ndarray  # m × 3, mm
    arrives: np.ndarray
    off: float  # mm, largest distance from the straight line

    @property
    def spread(self) -> float:
        """Between the first axis that arrives and the last, s."""
        there = self.arrives[~np.isnan(self.arrives)]
        return float(np.ptp(there)) if len(there) else 0.0


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """The rapids of each run. InputError for a program without a rapid of several axes, or data that will not do."""
    path, runs = read_gauges(files)
    numbers = [i for i, each in enumerate(path) if each.rapid and np.sum(np.abs(each.end - each.start) > _STILL) > 1]
    if not numbers:
        raise InputError("the path has no rapid of several axes; measure a program with one, as in G0 X70 Y20")
    rapids = [_rapid(run, path[i], i, settings["settled"]) for run in runs for i in numbers]
    columns = ["run", "line", "move", *(f"{name} arrives [s]" for name in LINEAR), "apart [s]", "off the line [mm]"]
    columns += ["by formula [mm]"]
    note = (
        "By formula: off the straight line if all axes go at one speed, each for itself. Axes that are led together "
        "stay on the line."
    )
    digits = dict.fromkeys(columns[3:], 3)
    return Report(
        "unsynchronized-rapids",
        "Rapid moves of several axes",
        [file.name for file in files],
        settings,
        [Table("Rapids", columns, [_row(rapid) for rapid in rapids], note, digits)],
        {"figure 6.4": lambda: _picture(rapids)},
        [_finding(rapid, settings["together"]) for rapid in rapids],
    )


def _rapid(run: Readings, segment: Segment, number: int, settled: float) -> Rapid:
    here = np.flatnonzero(run.segment == number)
    if not len(here):
        raise InputError(f"{run.name}: there are no readings on the rapid of line {segment.line}; measure it, too")
    position = run.position[here]
    elapsed = run.time[here] - run.time[here[0]]
    arrives = np.full(3, np.nan)
    for axis in np.flatnonzero(np.abs(segment.end - segment.start) > _STILL):
        # as far as it gets, not as far as it should: an axis that lost steps arrives as well
        progress = position[:, axis] * np.sign(segment.end[axis] - segment.start[axis])
        arrives[axis] = elapsed[np.argmax(progress >= progress.max() - settled)]
    return Rapid(run.name, segment, position, arrives, float(_off(position, segment).max()))


def _off(points: np.ndarray, segment: Segment) -> np.ndarray:
    """Distance of each point from the straight line, mm."""
    way = segment.end - segment.start
    away = points - segment.start
    found: np.ndarray = np.linalg.norm(away - np.outer(away @ way / (way @ way), way), axis=1)
    return found


def by_formula(way: np.ndarray) -> float:
    """How far off the line axes of one speed go that each go for themselves, mm: at the arrival of one of them."""
    turns = np.array([np.clip(way, -reach, reach) for reach in np.abs(way)])
    along = turns @ way / (way @ way)
    return float(np.linalg.norm(turns - np.outer(along, way), axis=1).max())


def _row(rapid: Rapid) -> list[Any]:
    way = rapid.segment.end - rapid.segment.start
    move = " ".join(f"{name}{value:g}" for name, value in zip(LINEAR, way, strict=True) if abs(value) > _STILL)
    arrives = [None if np.isnan(value) else float(value) for value in rapid.arrives]
    return [rapid.run, rapid.segment.line, move, *arrives, rapid.spread, rapid.off, by_formula(way)]


def _finding(rapid: Rapid, together: float) -> str:
    said = f"{rapid.run}, line {rapid.segment.line}: "
    if rapid.spread <= together:
        return f"{said}the axes arrive together, and leave the line by {rapid.off:.3f} mm at most."
    order = [LINEAR[i] for i in np.argsort(rapid.arrives) if not np.isnan(rapid.arrives[i])]
    return f"{said}{order[0]} arrives {rapid.spread:.2f} s before {order[-1]}; {rapid.off:.2f} mm off the line."


def _picture(rapids: Sequence[Rapid]) -> Picture:
    """The ways of the two axes that move farthest, one over the other, with the straight line between."""
    from rds.core.figure import CYCLE, GREY, Picture, dress, legend

    drawn = Picture(4.2)
    axes = drawn.subplots()
    first, second = np.sort(np.argsort(-np.max([np.abs(r.segment.end - r.segment.start) for r in rapids], axis=0))[:2])
    for number, rapid in enumerate(rapids):
        ends = np.array([rapid.segment.start, rapid.segment.end])
        axes.plot(ends[:, first], ends[:, second], color=GREY, linewidth=3.0, alpha=0.4)
        style: dict[str, Any] = {"linestyle": ("-", "--", ":", "-.")[number % 4], "color": CYCLE[number % len(CYCLE)]}
        label = f"{rapid.run}, line {rapid.segment.line}"
        axes.plot(rapid.position[:, first], rapid.position[:, second], label=label, **style)
    dress(axes, f"{LINEAR[second]} [mm]", f"{LINEAR[first]} [mm]")
    legend(axes)
    return drawn
