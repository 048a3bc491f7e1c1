"""Full circles in a table of two linear axes: where they are, and at steady feed, run-in and run-out left out.

A table with references (`X_reference`, `X_measured`: what a run leaves) tells the programmed circle. Measured positions
alone (`x_mm`, `y_mm`, maybe `time_s`) are taken for those of one circle, with its centre that of least squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from math import pi
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.reading import read_columns

LEAST = 270.0  # degrees: on less, a centre and an ellipse can hardly be told from each other
_NEAR, _STEADY = 0.05, 0.05  # of the radius and of the feed: what is farther off belongs to run-in or run-out
_PROGRAMMED = 0.002, 0.02  # of the radius, mm: a programmed path that is farther off the circle is no part of it
_FEWEST = 36  # readings of a circle
_REMEDY = "measure two turns each way, as in `rds nc bundled circular_test`"


@dataclass(frozen=True)
class Arc:
    """At most one turn at steady feed: measured `points` (n x 2, mm), `sense` (1 counter-clockwise, -1 clockwise).

    `centre` and `radius` (mm) are the programmed ones, or those of least squares where `lag` is None. `lag`: of both
    axes behind their references on average, rad. `rate`: rad/s, None without times.
    """

    axes: tuple[str, str]
    sense: int
    points: np.ndarray
    steady: float  # degrees at steady feed, of which `points` are the middle turn
    centre: np.ndarray
    radius: float
    rate: float | None
    lag: float | None
    resolution: float  # mm, the smallest step of the readings


def fit_circle(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius (mm) of the least squares of the radial distances."""
    middle = points.mean(axis=0)
    apart = points - middle
    ones = np.ones((len(apart), 1))
    x, y, rest = np.linalg.lstsq(np.hstack([2 * apart, ones]), (apart**2).sum(axis=1), rcond=None)[0]  # to begin with
    centre, radius = np.array([x, y]), float(np.sqrt(max(rest + x * x + y * y, 0.0)))
    for _ in range(5):  # Gauss and Newton
        length = np.maximum(np.hypot(*(apart - centre).T), 1e-12)[:, None]
        step = np.linalg.lstsq(np.hstack([(apart - centre) / length, ones]), length[:, 0], rcond=None)[0]
        centre, radius = centre + step[:2], float(step[2])
    return middle + centre, radius


def find_arcs(file: Path, axes: str | None) -> list[Arc]:
    """The longest circle of each sense, counter-clockwise first. InputError with the remedy where there is none."""
    columns = _columns(file)
    measured = {name.removesuffix("_measured"): each for name, each in columns.items() if name.endswith("_measured")}
    measured = measured or {name.upper(): each for name, each in columns.items() if len(name) == 1 and name != "t"}
    names = axes.upper().replace(" ", "").split(",") if axes else list(measured)
    there = ", ".join(measured) or "none"
    if axes and not set(names) <= set(measured):
        raise InputError(f"axes={axes}: the linear axes in mm are {there}; name two of them", str(file))
    if len(names) < 2:
        raise InputError(
            f"a circle needs two linear axes in mm, and there are {there}; give columns x_mm and y_mm, or X_measured "
            "[mm] and Y_measured [mm], and convert those in another unit",
            str(file),
        )
    found, said = list[Arc](), ""
    for one, other in combinations(names, 2):
        pair = (other, one) if (one, other) == ("X", "Z") else (one, other)  # as G18 looks at its plane
        try:
            points = np.column_stack([measured[name] for name in pair])
            found = max(found, _arcs(columns, points, pair), key=lambda arcs: sum(arc.steady for arc in arcs))
        except InputError as error:
            said = said or str(error)
    if not found:
        raise InputError(f"{said}; {_REMEDY}", str(file))
    return found


def _columns(file: Path) -> dict[str, np.ndarray]:
    """Columns in mm by name, and the time as `t`; from a saved run as from a table."""
    if file.is_dir() or file.suffix.lower() in (".parquet", ".mat"):
        from rds.results import open_result

        result = open_result(file)
        return {"t" if name == "time" else name: result[name] for name in result if result.units[name] in ("mm", "s")}
    every = {
        ("t" if each.unit == "s" else each.name): each
        for each in read_columns(file)
        if each.unit == "mm" or (each.unit == "s" and each.name.lower() in ("time", "t"))
    }
    return {name: np.array(each.numbers()) for name, each in every.items()}


def _arcs(columns: Mapping[str, np.ndarray], points: np.ndarray, pair: tuple[str, str]) -> list[Arc]:
    wanted = [columns[key] for name in pair if (key := f"{name}_reference") in columns]
    path = np.column_stack(wanted) if len(wanted) == 2 else points
    time, where = columns.get("t"), f"{pair[0]} and {pair[1]}"
    moves = np.linalg.norm(np.diff(path, axis=0, append=path[-1:]), axis=1) > 1e-7
    if moves.sum() < _FEWEST:
        raise InputError(f"{where} move in {moves.sum()} readings only, and a circle has {_FEWEST} at least")
    share, least = _PROGRAMMED if path is not points else (_NEAR, 0.0)
    centre, radius = _most_of(path[moves], share, least)
    for _ in range(5):
        on = moves & (np.abs(np.hypot(*(path - centre).T) - radius) <= max(share * radius, least))
        if on.sum() >= _FEWEST:
            centre, radius = fit_circle(path[on])
    parts = [part for part in _one_way(path - centre, on, time) if len(part) >= _FEWEST]
    steps = np.concatenate([np.diff(np.unique(np.round(each, 7))) for each in points.T])
    best: dict[int, Arc] = {}
    for part in parts:
        there, here = (_turning(each[part] - centre) for each in (path, points))
        sweep = float(there[-1] - there[0])
        middle = np.abs(here - (here[0] + here[-1]) / 2) <= pi
        behind = np.angle(np.exp(1j * (there - here))) * np.sign(sweep)  # of the whole point, not of an axis
        arc = Arc(
            pair,
            int(np.sign(sweep)),
            points[part][middle],
            float(np.degrees(abs(sweep))),
            centre,
            radius,
            None if time is None else abs(sweep) / float(time[part[-1]] - time[part[0]]),
            float(behind[middle].mean()) if path is not points else None,
            float(steps.min(initial=np.inf)),
        )
        if arc.sense not in best or arc.steady > best[arc.sense].steady:
            best[arc.sense] = arc
    most = max((arc.steady for arc in best.values()), default=0.0)
    if most < LEAST:
        raise InputError(f"{where} go {most:.0f}° of a circle at a steady feed, and this test needs {LEAST:g}°")
    return sorted((arc for arc in best.values() if arc.steady >= LEAST), key=lambda arc: -arc.sense)


def _most_of(path: np.ndarray, share: float, least: float) -> tuple[np.ndarray, float]:
    """The circle through three points, as far apart as on one turn or less, that most of the path is near to."""
    some = path[:: max(1, len(path) // 2000)]
    best, most = (some.mean(axis=0), 0.0), -1
    for apart in (len(some) // parts for parts in (6, 12, 24, 48)):
        for first in range(0, len(some) - 2 * apart, 1 + len(some) // 100):
            one, other, third = some[first : first + 2 * apart + 1 : max(apart, 1)][:3]
            sides = 2 * np.array([other - one, third - one])
            if abs(np.linalg.det(sides)) > 1e-9:
                centre = np.linalg.solve(sides, [other @ other - one @ one, third @ third - one @ one])
                radius = float(np.hypot(*(one - centre)))
                near = (np.abs(np.hypot(*(some - centre).T) - radius) <= max(share * radius, least)).sum()
                if near > most and radius < 0.7 * np.ptp(some, axis=0).max():  # no line, which is a circle, too
                    best, most = (centre, radius), near
    return best


def _turning(spokes: np.ndarray) -> np.ndarray:
    return np.unwrap(np.arctan2(spokes[:, 1], spokes[:, 0]))


def _slope(values: np.ndarray) -> np.ndarray:
    """Differences over a few readings to either side."""
    i, few = np.arange(len(values)), 1 + len(values) // 400
    return np.asarray(values[np.minimum(i + few, len(i) - 1)] - values[np.maximum(i - few, 0)])


def _one_way(spokes: np.ndarray, on: np.ndarray, time: np.ndarray | None) -> list[np.ndarray]:
    """Stretches of rows that are on the circle, turn one way, and do so at a steady feed where times are known."""
    rows, found = np.flatnonzero(on), []
    for stretch in np.split(rows, np.flatnonzero(np.diff(rows) > 1 + len(on) // 400) + 1):
        way = np.sign(_slope(_turning(spokes[stretch])))
        for part in np.split(stretch, np.flatnonzero(np.diff(way)) + 1):
            if time is not None and len(part) > 2:
                with np.errstate(divide="ignore", invalid="ignore"):  # times that stand still are no steady feed
                    rate = np.abs(_slope(_turning(spokes[part])) / _slope(time[part]))
                    steady = np.flatnonzero(np.abs(rate - np.median(rate)) <= _STEADY * np.median(rate))
                part = part[steady[0] : steady[-1] + 1] if len(steady) else part[:0]
            found.append(part)
    return found
