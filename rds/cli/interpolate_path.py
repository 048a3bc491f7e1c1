"""The segments that `rds interpolate` is given: words of the command line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from rds.core.errors import InputError
from rds.core.geometry import PLANES
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.interpolators.segment_rows import FEED_UNITS

_FEED = re.compile(r"\s*([^\s/a-z]+)\s*([a-z/]*)\s*")


def feed_rate(text: str) -> float:
    """mm/s, from a number of mm/min or a number with its unit. InputError for anything else."""
    match = _FEED.fullmatch(text)
    unit = (match[2] or "mm/min") if match else ""
    try:
        value = float(match[1]) if match else 0.0
    except ValueError:
        value = 0.0
    if unit not in FEED_UNITS or not 0.0 < value < float("inf"):
        units = ", ".join(FEED_UNITS)
        raise InputError(f"--feed {text!r} must be a number above 0 with a unit: {units} (without one: mm/min)")
    return value * FEED_UNITS[unit]


def line(text: str, feed: float) -> list[Segment]:
    """Straight moves over points: "0,0:30,40:60,0", mm, one to three axes each; `feed` in mm/s."""
    points = _points(text, "--line")
    if len(points) < 2:
        raise InputError(f"--line {text!r} needs two points or more, as in --line 0,0:30,40")
    return [LineSegment(a, b, feed) for a, b in pairwise(points)]


def arc(text: str, feed: float, clockwise: bool, plane: str) -> list[Segment]:
    """An arc: "START:END:CENTRE", mm, two or three axes; `feed` in mm/s."""
    points = _points(text, "--arc")
    if len(points) != 3:
        raise InputError(f"--arc {text!r} needs start, end and centre, as in --arc 10,0:0,10:0,0")
    if plane.upper() not in PLANES:
        raise InputError(f"--plane {plane!r} must be one of {', '.join(PLANES)}")
    axes = PLANES[plane.upper()]
    if max(axes) >= len(points[0]):
        raise InputError(f"--arc {text!r}: its points need {max(axes) + 1} axes for the plane {plane.upper()}")
    return [ArcSegment(points[0], points[1], points[2], feed, clockwise, axes)]


def _points(text: str, option: str) -> list[tuple[float, ...]]:
    try:
        points = [tuple(float(cell) for cell in point.split(",")) for point in text.split(":")]
    except ValueError as error:
        raise InputError(
            f"{option} {text!r}: {error}; write points in mm, a comma between axes and a colon between points"
        ) from error
    _check_axes(points, text, option)
    return points


def _check_axes(points: Sequence[tuple[float, ...]], text: str, option: str) -> None:
    counts = {len(point) for point in points}
    if len(counts) != 1 or not counts <= {1, 2, 3}:
        raise InputError(f"{option} {text!r}: give every point the same number of axes, one to three: X, Y, Z")
