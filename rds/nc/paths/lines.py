"""Straight paths: line, quadrilateral, polyline."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, radians, sin

from rds.core.errors import InputError
from rds.core.types import LineSegment, Segment
from rds.nc.paths.numbers import ANGLE, COORDINATE, FEED_RATE, POSITIVE, number, point, point_text

Corner = Sequence[float]


def line(start: Corner, end: Corner, feed_rate: float) -> list[Segment]:
    """A straight cut from `start` to `end` (x, y or x, y, z in mm; z is 0 unless given), `feed_rate` in mm/s.

    The "line" of three-axis-mill: all axes start and end together. InputError where the points are the same.
    """
    return polyline([start, end], feed_rate, owner="line", names=["start", "end"])


def polyline(
    points: Sequence[Corner],
    feed_rate: float,
    *,
    closed: bool = False,
    owner: str = "polyline",
    names: Sequence[str] | None = None,
) -> list[Segment]:
    """Straight cuts through `points` (n of x, y or x, y, z, mm), back to the first where `closed`; mm/s.

    `owner` and `names` say in messages what and which point is meant. InputError for fewer than two points, or two
    equal ones in a row.
    """
    feed = number(feed_rate, "feed rate", owner, FEED_RATE)
    called = list(names or (f"point {k}" for k in range(1, len(points) + 1)))
    corners = [point(values, name, owner) for values, name in zip(points, called, strict=True)]
    if len(corners) < 2:
        raise InputError(f"{owner}: {len(corners)} points make no path; give at least two")
    if closed:
        corners, called = [*corners, corners[0]], [*called, called[0]]
    segments: list[Segment] = []
    for k in range(len(corners) - 1):
        if corners[k] == corners[k + 1]:
            raise InputError(
                f"{owner}: {called[k]} and {called[k + 1]} are the same point {point_text(corners[k])}; "
                "there is nothing to cut between them: change or leave out one"
            )
        segments.append(LineSegment(corners[k], corners[k + 1], feed))
    return segments


def quadrilateral(corners: Sequence[Corner], feed_rate: float) -> list[Segment]:
    """A closed path through four `corners` (x, y or x, y, z, mm), in their order, and back to the first; mm/s.

    The "square" of three-axis-mill, which "actually allows the definition of any quadrilateral". InputError unless
    there are four corners, and no side has length 0.
    """
    if len(corners) != 4:
        raise InputError(f"quad: {len(corners)} corners; a quadrilateral has 4 (for others, give a file of points)")
    return polyline(corners, feed_rate, closed=True, owner="quad", names=[f"corner {k}" for k in range(1, 5)])


def quadrilateral_by_moves(
    start: Corner, moves: Sequence[tuple[float, float, float]], feed_rate: float
) -> list[Segment]:
    """A quadrilateral by its first corner (mm) and three moves; the fourth leads back to the start by itself.

    Each move is (direction, degrees from +X counter-clockwise; length in the XY plane, mm; change in z, mm; up is
    positive). The parametric form that three-axis-mill describes beside its arc window. `feed_rate` in mm/s.
    """
    if len(moves) != 3:
        raise InputError(f"quad: {len(moves)} moves; give 3, the fourth side leads back to the start")
    corners = [point(start, "start", "quad")]
    for k, move in enumerate(moves, start=1):
        if len(move) not in (2, 3):
            raise InputError(f"quad: move {k} = {move!r} must be direction in degrees, length in mm, change in z in mm")
        direction = radians(number(move[0], f"direction of move {k}", "quad", ANGLE))
        length = number(move[1], f"length of move {k}", "quad", POSITIVE)
        rise = number(move[2], f"change in z of move {k}", "quad", COORDINATE) if len(move) == 3 else 0.0
        x, y, z = corners[-1]
        corners.append((x + length * cos(direction), y + length * sin(direction), z + rise))
    return quadrilateral(corners, feed_rate)
