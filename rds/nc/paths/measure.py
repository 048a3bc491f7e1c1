"""What a path is: its pieces, length and extent, and points along it."""

from __future__ import annotations

from collections.abc import Sequence
from math import acos, atan2, ceil, dist, pi

import numpy as np

from rds.core.geometry import length, radius, sweep
from rds.core.types import ArcSegment, LineSegment, Segment

SAME = 1e-9  # mm: ends nearer than this are one point


def pieces(segments: Sequence[Segment]) -> list[list[Segment]]:
    """The path in pieces without a gap: a new one begins where a segment does not start at the end of the last."""
    found: list[list[Segment]] = []
    for segment in segments:
        if found and dist(found[-1][-1].end, segment.start) <= SAME:
            found[-1].append(segment)
        else:
            found.append([segment])
    return found


def is_closed(piece: Sequence[Segment]) -> bool:
    """Whether a piece ends where it starts, seen from above: the last of several passes ends below it."""
    return dist(piece[0].start[:2], piece[-1].end[:2]) <= SAME


def sampled(segment: Segment, chord_error: float) -> np.ndarray:
    """Points along a segment, shape (n, axes), mm: its ends, and of an arc so many that chords keep within the error.

    The extremes of an arc in x and y are among them.
    """
    start = np.asarray(segment.start, dtype=float)
    if isinstance(segment, LineSegment):
        return np.array([start, segment.end])
    r, turn = radius(segment), sweep(segment)
    step = 2 * acos(max(1 - chord_error / r, 0.0)) if r > chord_error else pi / 2
    parts = np.linspace(0.0, 1.0, ceil(abs(turn) / max(step, 1e-4)) + 1)
    i, j = segment.plane
    first = atan2(segment.start[j] - segment.centre[j], segment.start[i] - segment.centre[i])
    low, high = sorted((first, first + turn))
    quadrants = np.arange(ceil(low / (pi / 2)), high / (pi / 2)) * (pi / 2)
    parts = np.unique(np.concatenate([parts, np.clip((quadrants - first) / turn, 0.0, 1.0)]))
    points = start + parts[:, None] * (np.asarray(segment.end) - start)
    points[:, i] = segment.centre[i] + r * np.cos(first + turn * parts)
    points[:, j] = segment.centre[j] + r * np.sin(first + turn * parts)
    points[0], points[-1] = start, segment.end
    return points


def trace(piece: Sequence[Segment], chord_error: float = 1e-3) -> np.ndarray:
    """The points of a piece without a gap, shape (n, axes), mm: chords keep within the error."""
    rows = [sampled(segment, chord_error) for segment in piece]
    return np.concatenate([rows[0], *(more[1:] for more in rows[1:])])


def total_length(segments: Sequence[Segment]) -> float:
    """mm, without the ways between pieces."""
    return sum(map(length, segments))


def extent(segments: Sequence[Segment]) -> list[tuple[float, float]]:
    """Least and largest coordinate for each axis, mm; of arcs too."""
    points = np.concatenate([sampled(segment, 0.1 * max(_size(segment), 1e-6)) for segment in segments])
    return list(zip(points.min(axis=0).tolist(), points.max(axis=0).tolist(), strict=True))


def _size(segment: Segment) -> float:
    return radius(segment) if isinstance(segment, ArcSegment) else 1.0


def signed_area(points: np.ndarray) -> float:
    """Area within a closed polygon of shape (n, 2), first point repeated or not; positive counter-clockwise."""
    x, y = points[:, 0] - points[0, 0], points[:, 1] - points[0, 1]
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def without_repeats(points: np.ndarray) -> np.ndarray:
    """The rows that are not the same as the row before."""
    keep = np.ones(len(points), dtype=bool)
    keep[1:] = np.any(points[1:] != points[:-1], axis=1)
    return points[keep]


def summary(segments: Sequence[Segment]) -> dict[str, object]:
    """A path in numbers: lines, arcs, pieces, closed, length and extent (mm), cutting time (s), start."""
    found = pieces(segments)
    names = "XYZ"[: len(segments[0].start)]
    return {
        "lines": sum(isinstance(segment, LineSegment) for segment in segments),
        "arcs": sum(isinstance(segment, ArcSegment) for segment in segments),
        "pieces": len(found),
        "closed": all(map(is_closed, found)),
        "length_mm": total_length(segments),
        "cutting_time_s": sum(length(segment) / segment.feed_rate for segment in segments),
        "start_mm": list(segments[0].start),
        "end_mm": list(segments[-1].end),
        "extent_mm": {axis: list(bounds) for axis, bounds in zip(names, extent(segments), strict=True)},
    }
