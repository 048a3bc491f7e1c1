"""Path error: arcs by their radial deviation, straight moves by the distance from their line, corners by overshoot.

Source: dcs-thesis, section 5.5, figures 5.17 to 5.20: a circular and a rectangular path measured with a caliper of
0.01 mm; on the circle 0.12 mm at most and 0.035 mm on average. The overshoot of a corner is how far the tool goes past
it in the direction in which it came.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.gauges import STRAIGHT, Readings, Segment, read_gauges
from rds.results.reports.settings import Setting

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "corner": Setting("a turn of less than this is no corner", "deg", 5.0, more_than=0, at_most=179),
    "magnify": Setting("how many times larger the picture shows errors", default=200.0, more_than=0),
}
_THESIS = ["dcs-thesis, figure 5.18", None, None, "arc", None, None, None, 120.0, 35.0, None]


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Errors of each feed move, and of each corner. InputError for data that will not do."""
    path, runs = read_gauges(files)
    feeds = [i for i, each in enumerate(path) if not each.rapid and _length(each) > 0.0]
    if not feeds:
        raise InputError("the path has no feed moves; measure a program with G1, G2 or G3")
    columns = ["run", "line", "readings", "shape", "nominal [mm]", "mean deviation [µm]", "std [µm]"]
    columns += ["largest [µm]", "mean of amounts [µm]", "out of round or straight [µm]"]
    rows = [_row(run, path[i], i) for run in runs for i in feeds if len(run.within(i))]
    if any(path[i].plane != STRAIGHT for i in feeds):
        rows.append(_THESIS)
    note = (
        "Deviation: of an arc radially, positive outward; of a straight move from its line, as an amount. Nominal: "
        "radius or length. Out of round or straight: largest less smallest deviation."
    )
    tables = [Table("Path error", columns, rows, note, dict.fromkeys(columns[5:], 2))]
    found = _corners(path, settings["corner"])
    corners = [[run.name, *_corner_row(run, path, i, turn)] for run in runs for i, turn in found]
    if corners:
        heads = ["run", "line", "next line", "turn [deg]", "overshoot [µm]", "cut off [µm]"]
        tables.append(Table("Corners", heads, corners, digits=dict.fromkeys(heads[3:], 1)))
    return Report(
        "path-error",
        "Path error of arcs, straight moves and corners",
        [file.name for file in files],
        settings,
        tables,
        {"path": lambda: _picture(path, feeds, runs, settings["magnify"])},
        [_finding(run, path, feeds) for run in runs],
    )


def _length(segment: Segment) -> float:
    if segment.plane != STRAIGHT:
        return segment.radius
    return float(np.linalg.norm(segment.end - segment.start))


def deviation(points: np.ndarray, segment: Segment) -> np.ndarray:
    """Of each point (m × 3), mm: radially outward from an arc, or its distance from a straight line."""
    if segment.plane != STRAIGHT:
        spoke = (points - segment.centre)[:, segment.across]
        return np.asarray(np.hypot(*spoke.T) - segment.radius)
    way = segment.end - segment.start
    away = points - segment.start
    return np.asarray(np.linalg.norm(away - np.outer(away @ way / (way @ way), way), axis=1))


def _row(run: Readings, segment: Segment, number: int) -> list[Any]:
    off = deviation(run.within(number), segment) * 1e3
    amounts = np.abs(off)
    shape = "straight" if segment.plane == STRAIGHT else "arc"
    spread = float(off.std(ddof=1)) if len(off) > 1 else None
    numbers = [_length(segment), float(off.mean()), spread, float(amounts.max()), float(amounts.mean())]
    return [run.name, segment.line, len(off), shape, *numbers, float(np.ptp(off))]


def _corners(path: Sequence[Segment], least: float) -> list[tuple[int, float]]:
    """Straight feeds that the next one meets at an angle, and by how much the path turns there, degrees."""
    found = []
    for i, (one, other) in enumerate(pairwise(path)):
        if one.rapid or other.rapid or {one.plane, other.plane} != {STRAIGHT}:
            continue
        ways = [each.end - each.start for each in (one, other)]
        lengths = [float(np.linalg.norm(way)) for way in ways]
        if min(lengths) > 0.0:
            turn = float(np.degrees(np.arccos(np.clip(ways[0] @ ways[1] / (lengths[0] * lengths[1]), -1.0, 1.0))))
            if turn >= least:
                found.append((i, turn))
    return found


def _corner_row(run: Readings, path: Sequence[Segment], i: int, turn: float) -> list[Any]:
    """Lines, the turn, how far past the corner the tool goes, and how near to it the tool comes."""
    corner, way = path[i].end, path[i].end - path[i].start
    before, around = run.within(i), np.concatenate((run.within(i), run.within(i + 1)))
    past = around if turn >= 90.0 else before  # after a lesser turn the next move itself leads on
    overshoot = float(((past - corner) @ way / np.linalg.norm(way)).max(initial=0.0))
    cut = float(np.linalg.norm(around - corner, axis=1).min()) if len(around) else None
    return [path[i].line, path[i + 1].line, turn, overshoot * 1e3, None if cut is None else cut * 1e3]


def _finding(run: Readings, path: Sequence[Segment], feeds: Sequence[int]) -> str:
    off, worst = max((float(np.abs(deviation(run.within(i), path[i])).max(initial=0.0)), path[i].line) for i in feeds)
    return f"{run.name}: {off * 1e3:.1f} µm at most, in line {worst}."


def _picture(path: Sequence[Segment], feeds: Sequence[int], runs: Sequence[Readings], magnify: float) -> Picture:
    """The feeds from above, with the deviations enlarged."""
    from rds.core.figure import CYCLE, GREY, Picture, dress, legend

    drawn = Picture(6.0)
    axes = drawn.subplots()
    for run, colour in zip(runs, CYCLE * len(runs), strict=False):
        shown = []
        for i in feeds:
            points = run.within(i)
            nearest = _nearest(points, path[i])
            axes.plot(nearest[:, 0], nearest[:, 1], color=GREY, linewidth=2.5, alpha=0.5)
            shown.append(nearest + magnify * (points - nearest))
        whole = np.concatenate(shown)
        axes.plot(whole[:, 0], whole[:, 1], color=colour, linewidth=0.8, label=f"{run.name}, errors x {magnify:g}")
    axes.set_aspect("equal", adjustable="datalim")
    dress(axes, "Y [mm]", "X [mm]")
    legend(axes)
    return drawn


def _nearest(points: np.ndarray, segment: Segment) -> np.ndarray:
    """The place on the segment's line or circle that is nearest to each point."""
    if segment.plane == STRAIGHT:
        way = segment.end - segment.start
        share = np.clip((points - segment.start) @ way / (way @ way), 0.0, 1.0)
        return np.asarray(segment.start + np.outer(share, way))
    found = points.copy()
    spoke = (points - segment.centre)[:, segment.across]
    lengths = np.maximum(np.hypot(*spoke.T), 1e-12)[:, None]
    found[:, segment.across] = segment.centre[segment.across] + spoke * segment.radius / lengths
    return found
