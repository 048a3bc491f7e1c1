"""Arcs and lines through points: as few as keep within a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, inf, pi

import numpy as np

from rds.core.types import ArcSegment, LineSegment, Segment

LARGEST_RADIUS = 1e5  # mm: beyond it an arc is a line, and its centre has no decimals left
_LEVEL = 1e-9  # mm: points of one height
_FEWEST = 3  # chords that an arc must stand for


def fit(points: np.ndarray, tolerance: float, feed_rate: float) -> tuple[list[Segment], float]:
    """Lines and arcs along the polyline through `points` (shape (n, 3), mm), and how far they are from it at most, mm.

    The deviation is that of the whole polyline from the path and of the path from the polyline (Hausdorff distance), at
    most `tolerance`: so sparse points, whose chords are farther from a circle than that, stay lines. Arcs lie in the XY
    plane, where z does not change, turn by half a turn at most and stand for three chords or more. Each segment goes as
    far as it can; `feed_rate` in mm/s.
    """
    segments: list[Segment] = []
    worst, here, last = 0.0, 0, len(points) - 1
    while here < last:
        rest = points[here:]
        ahead, deviation = _farthest(_deviation_of(chord_deviation, rest), 1, last - here, tolerance)
        arc_ahead, arc_deviation = _farthest(_deviation_of(_arc_deviation, rest), _FEWEST, last - here, tolerance)
        start = tuple(points[here].tolist())
        if arc_ahead > ahead:
            ahead, deviation = arc_ahead, arc_deviation
            (centre, clockwise), _ = arc_through(rest[: ahead + 1])
            end = tuple(rest[ahead].tolist())
            segments.append(ArcSegment(start, end, (*centre, start[2]), feed_rate, clockwise))
        else:
            segments.append(LineSegment(start, tuple(rest[ahead].tolist()), feed_rate))
        here, worst = here + ahead, max(worst, deviation)
    return segments, worst


def _deviation_of(measure: Callable[[np.ndarray], float], points: np.ndarray) -> Callable[[int], float]:
    return lambda ahead: measure(points[: ahead + 1])


def _arc_deviation(points: np.ndarray) -> float:
    return arc_through(points)[1]


def _farthest(deviation: Callable[[int], float], first: int, last: int, tolerance: float) -> tuple[int, float]:
    """The largest index found whose deviation keeps within the tolerance, by doubling and halving; and its deviation.

    0 and infinity where not even the first does, or is beyond the last.
    """
    good, at_good, step, at = 0, inf, 1, first
    bad = last + 1
    while at <= last:
        now = deviation(at)
        if now > tolerance:
            bad = at
            break
        good, at_good = at, now
        at, step = min(at + step, last) if at < last else last + 1, step * 2
    while good and bad - good > 1:
        middle = (good + bad) // 2
        now = deviation(middle)
        if now <= tolerance:
            good, at_good = middle, now
        else:
            bad = middle
    return good, at_good


def chord_deviation(points: np.ndarray) -> float:
    """Hausdorff distance of the polyline through `points` (n, k) and the straight piece between its ends.

    The distance to a straight piece is convex, so the polyline is farthest at one of its points; and the polyline
    passes over each point of the chord.
    """
    if len(points) < 3:
        return 0.0
    chord = points[-1] - points[0]
    along = np.clip((points - points[0]) @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
    return float(np.linalg.norm(points - points[0] - along[:, None] * chord, axis=1).max())


def arc_through(points: np.ndarray) -> tuple[tuple[tuple[float, float], bool], float]:
    """The arc from the first to the last of `points` (n, 3) that fits the others best: (centre, clockwise), deviation.

    Its centre is on the bisector of the chord, where the sum of squares of |p - c|² - r² is least. The deviation is
    infinite where no arc of half a turn or less will do: where z changes, the points turn back, or do not bend.
    """
    nothing: tuple[tuple[tuple[float, float], bool], float] = (((0.0, 0.0), False), inf)
    xy, z = points[:, :2], points[:, 2]
    chord = xy[-1] - xy[0]
    half = hypot(*chord) / 2
    if half < 1e-9 or np.ptp(z) > _LEVEL:
        return nothing
    normal = np.array([-chord[1], chord[0]]) / (2 * half)
    q = xy - (xy[0] + xy[-1]) / 2
    off = q @ normal
    denominator = 2 * float(off @ off)
    if denominator < 1e-18:
        return nothing
    h = float(((q * q).sum(axis=1) - half * half) @ off) / denominator
    r = hypot(half, h)
    if r > LARGEST_RADIUS:
        return nothing
    spoke = q - h * normal
    angles = np.unwrap(np.arctan2(spoke[:, 1], spoke[:, 0]))
    turned = np.diff(angles)
    sweep = float(angles[-1] - angles[0])
    if abs(sweep) > pi * (1 + 1e-9) or not (np.all(turned > 0) or np.all(turned < 0)):
        return nothing
    radial = np.abs(np.hypot(spoke[:, 0], spoke[:, 1]) - r)
    deviation = max(float(radial.max()), r - float(_nearest(spoke).min()))
    centre = (xy[0] + xy[-1]) / 2 + h * normal
    return ((float(centre[0]), float(centre[1])), sweep < 0), deviation


def _nearest(spoke: np.ndarray) -> np.ndarray:
    """How near each chord between neighbouring points comes to the centre (the origin)."""
    start, step = spoke[:-1], np.diff(spoke, axis=0)
    along = np.clip(-(start * step).sum(axis=1) / np.maximum((step * step).sum(axis=1), 1e-300), 0.0, 1.0)
    return np.linalg.norm(start + along[:, None] * step, axis=1)
