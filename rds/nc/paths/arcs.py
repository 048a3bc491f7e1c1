"""Arcs, circles and helices by centre, radius, start angle and sweep."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, cos, radians, sin

from rds.core.errors import InputError
from rds.core.types import ArcSegment, Segment
from rds.nc.paths.numbers import ANGLE, COORDINATE, FEED_RATE, POSITIVE, number, point

MOST_TURNS = 10_000
_WHOLE = 1e-9  # of a turn, by which a sweep may be off a whole one for rounding


def arc(
    centre: Sequence[float],
    radius: float,
    start_angle: float,
    sweep: float,
    feed_rate: float,
    *,
    depth: float = 0.0,
    end_depth: float | None = None,
) -> list[Segment]:
    """An arc in the XY plane, as the arc window of three-axis-mill (figure 36) describes it.

    `centre` x, y and `radius` in mm; `start_angle` in degrees from +X; `sweep` in degrees, positive counter-clockwise,
    360 a circle, more for several turns; `depth` in mm below z = 0 (z = -depth). With `end_depth` the arc becomes a
    helix that ends there. `feed_rate` in mm/s along the path. The source cuts chords of half a degree, and none of a
    helix; here each turn is one true arc.
    """
    x, y, _ = point(centre, "centre", "arc", sizes=(2,))
    r = number(radius, "radius", "arc", POSITIVE)
    first = number(start_angle, "start angle", "arc", ANGLE)
    swept = number(sweep, "sweep", "arc", ANGLE)
    feed = number(feed_rate, "feed rate", "arc", FEED_RATE)
    top = 0.0 - number(depth, "depth", "arc", COORDINATE)
    bottom = top if end_depth is None else 0.0 - number(end_depth, "end depth", "arc", COORDINATE)
    if abs(swept) < 1e-9:
        raise InputError(f"arc: sweep = {sweep!r} is no arc; give degrees, counter-clockwise positive, 360: a circle")
    turns = max(1, ceil(abs(swept) / 360.0 - _WHOLE))
    is_whole = abs(abs(swept) - 360.0 * turns) <= 360.0 * _WHOLE
    if turns > MOST_TURNS:
        raise InputError(f"arc: sweep = {sweep!r} is {turns} turns; give at most {MOST_TURNS}")

    def on_circle(angle: float, z: float) -> tuple[float, float, float]:
        return (x + r * cos(radians(angle)), y + r * sin(radians(angle)), z)

    segments: list[Segment] = []
    here = on_circle(first, top)
    for turn in range(turns):
        done = (turn + 1) * 360.0 / abs(swept) if turn < turns - 1 else 1.0
        there = on_circle(first + swept * done, top + (bottom - top) * done)
        if turn < turns - 1 or is_whole:  # a whole turn ends exactly where it began
            there = (here[0], here[1], there[2])
        segments.append(ArcSegment(here, there, (x, y, here[2]), feed, clockwise=swept < 0))
        here = there
    return segments
