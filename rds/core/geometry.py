"""The geometry of segments: radius, sweep and length."""

from __future__ import annotations

from math import atan2, dist, hypot, pi

from rds.core.types import ArcSegment, LineSegment, Segment

PLANES = {"XY": (0, 1), "ZX": (2, 0), "YZ": (1, 2)}  # of arcs: their axes by index, the normal towards the viewer


def radius(segment: ArcSegment) -> float:
    """Distance of the start from the centre in the arc's plane, mm."""
    i, j = segment.plane
    return hypot(segment.start[i] - segment.centre[i], segment.start[j] - segment.centre[j])


def sweep(segment: ArcSegment) -> float:
    """Angle from start to end, rad: positive counter-clockwise; a full turn where the end is the start."""
    i, j = segment.plane
    start, end = (
        atan2(point[j] - segment.centre[j], point[i] - segment.centre[i]) for point in (segment.start, segment.end)
    )
    turn = (end - start) % (2 * pi) or 2 * pi
    return turn if not segment.clockwise else turn - 2 * pi if turn < 2 * pi else -turn


def length(segment: Segment) -> float:
    """Length of the path, mm; of a helix, in all three dimensions."""
    if isinstance(segment, LineSegment):
        return dist(segment.start, segment.end)
    along = [b - a for k, (a, b) in enumerate(zip(segment.start, segment.end, strict=True)) if k not in segment.plane]
    return hypot(radius(segment) * sweep(segment), *along)
