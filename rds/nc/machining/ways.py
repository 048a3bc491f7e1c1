"""Ways of a tool at a depth: rings with ramps and tabs, as segments."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil, radians, tan

import numpy as np

from rds.core.types import LineSegment, Segment
from rds.nc.paths.arc_fit import fit

Piece = list[Segment]


def levels(top: float, depth: float, step_down: float) -> list[float]:
    """The heights z (mm) of equal passes of at most `step_down` from `top` to `depth` below z = 0."""
    count = max(ceil((top + depth) / step_down - 1e-9), 1)
    return [top - (top + depth) * (k + 1) / count for k in range(count)]


def at_height(points: np.ndarray, z: float) -> np.ndarray:
    """Rows x, y as rows x, y, z."""
    return np.column_stack((points, np.full(len(points), z)))


def path(points: np.ndarray, feed: float, tolerance: float) -> Piece:
    """Lines and arcs through rows x, y, z, within `tolerance` mm."""
    keep = np.ones(len(points), bool)
    keep[1:] = np.any(np.abs(points[1:] - points[:-1]) > 1e-7, axis=1)
    rows = points[keep]
    return fit(rows, tolerance, feed)[0] if len(rows) > 1 else []


def lines(points: Sequence[Sequence[float]] | np.ndarray, feed: float) -> Piece:
    """Straight cuts through rows x, y, z."""
    rows = [tuple(float(value) for value in row) for row in points]
    return [LineSegment(a, b, feed) for a, b in pairwise(rows) if a != b]


def along(ring: np.ndarray, start: float, length: float) -> np.ndarray:
    """The part of a closed ring (rows, first repeated) from the distance `start` on; it may go round several times."""
    steps = np.hypot(*np.diff(ring, axis=0).T)
    at = np.concatenate(([0.0], np.cumsum(steps)))
    total = at[-1]
    stop = start + length
    rounds = np.arange(int(start // total), int(stop // total) + 1) * total
    inner = (at[None, :-1] + rounds[:, None]).ravel()
    inner = inner[(inner > start + 1e-9) & (inner < stop - 1e-9)]
    places = np.concatenate(([start], inner, [stop]))
    around = np.mod(places, total)
    around[-1] = total if abs(around[-1]) < 1e-9 else around[-1]
    return np.column_stack([np.interp(around, at, ring[:, k]) for k in (0, 1)])


def ramp(ring: np.ndarray, high: float, low: float, angle: float, feed: float) -> tuple[Piece, float]:
    """Down along a ring from z = high to low at `angle` degrees, and how far along the ring that ends, mm.

    At 90 degrees, or where there is no way down, straight down.
    """
    if high <= low:
        return [], 0.0
    if angle >= 90.0:
        x, y = ring[0]
        return lines([(x, y, high), (x, y, low)], feed), 0.0
    length = (high - low) / tan(radians(angle))
    way = along(ring, 0.0, length)
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))))
    z = high + (low - high) * gone / gone[-1]
    return lines(np.column_stack((way, z)), feed), length


def ring_at(ring: np.ndarray, start: float, z: float, feed: float, tolerance: float) -> Piece:
    """Once around a ring at z, from the distance `start` on."""
    total = float(np.hypot(*np.diff(ring, axis=0).T).sum())
    return path(at_height(along(ring, start % total, total), z), feed, tolerance)


def rest_of_tab(start: float, tabs: list[tuple[float, float]], total: float) -> float:
    """How far the tab goes on that the distance `start` along a ring of `total` mm lies in; 0 beside all tabs."""
    rests = ((middle + width / 2 - start) % total for middle, width in tabs if _into(start, middle, width, total))
    return max(rests, default=0.0)


def _into(start: float, middle: float, width: float, total: float) -> bool:
    return 1e-9 < (start - middle + width / 2) % total < width - 1e-9


def ring_with_tabs(
    ring: np.ndarray,
    start: float,
    z: float,
    tabs: list[tuple[float, float]],
    top: float,
    feed: float,
    plunge: float,
    tolerance: float,
) -> Piece:
    """Once around a ring at z, and at `top` over the tabs: distances along the ring (middle, width), mm.

    `start` lies in none of them.
    """
    total = float(np.hypot(*np.diff(ring, axis=0).T).sum())
    start %= total
    spans = sorted(((middle - width / 2 - start) % total, width) for middle, width in tabs)
    found: Piece = []
    here = 0.0
    for begin, width in spans:
        begin = max(begin, here)
        if begin > here:
            found += path(at_height(along(ring, start + here, begin - here), z), feed, tolerance)
        end = min(begin + width, total)
        over = along(ring, start + begin, end - begin)
        rise = [(*over[0], z), *((*point, top) for point in over)]
        found += lines(rise, feed) + lines([(*over[-1], top), (*over[-1], z)], plunge)
        here = end
    if here < total:
        found += path(at_height(along(ring, start + here, total - here), z), feed, tolerance)
    return found
