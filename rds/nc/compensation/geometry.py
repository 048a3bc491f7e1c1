"""Where offset lines and circles cross: the plane geometry of cutter compensation. Points are (u, v), in the plane."""

from __future__ import annotations

from math import atan2, dist, hypot, inf, pi, sqrt

from rds.nc.language.errors import ProgramError

Point = tuple[float, float]


def unit(start: Point, end: Point) -> Point:
    """The direction from one point to another, of length 1. Raises ProgramError where rounding has made them one."""
    u, v = end[0] - start[0], end[1] - start[1]
    length = hypot(u, v)
    if not 0 < length < inf:
        raise ProgramError(
            f"the points {start[0]:g}, {start[1]:g} and {end[0]:g}, {end[1]:g} are too far out for the cutter's radius:"
            " rounding swallows it; use smaller coordinates"
        )
    return (u / length, v / length)


def along(point: Point, direction: Point, distance: float) -> Point:
    """The point `distance` farther along a direction of length 1."""
    return (point[0] + direction[0] * distance, point[1] + direction[1] * distance)


def sweep(start: Point, centre: Point, turn: int, end: Point) -> float:
    """The angle of an arc, rad: in (0, 2π] for turn = 1, in [-2π, 0) for -1, a circle more for each turn more."""
    angle = atan2(end[1] - centre[1], end[0] - centre[0]) - atan2(start[1] - centre[1], start[0] - centre[0])
    if turn > 0:
        return (angle if angle > 0 else angle + 2 * pi) + (turn - 1) * 2 * pi
    return (angle if angle < 0 else angle - 2 * pi) + (turn + 1) * 2 * pi


def line_line(point: Point, direction: Point, other: Point, other_direction: Point) -> Point | None:
    """Where two lines cross; None where they are parallel."""
    cross = direction[0] * other_direction[1] - direction[1] * other_direction[0]
    if cross == 0:
        return None
    way = (other[0] - point[0]) * other_direction[1] - (other[1] - point[1]) * other_direction[0]
    return along(point, direction, way / cross)


def _chord(point: Point, direction: Point, centre: Point, radius: float, forward: bool) -> Point | None:
    """Where a line cuts a circle, the later or the earlier crossing; None where it passes by."""
    way = (centre[0] - point[0]) * direction[0] + (centre[1] - point[1]) * direction[1]
    foot = along(point, direction, way)
    square = radius * radius - (foot[0] - centre[0]) ** 2 - (foot[1] - centre[1]) ** 2
    if square < 0:
        return None
    return along(foot, direction, sqrt(square) if forward else -sqrt(square))


def line_arc(point: Point, direction: Point, centre: Point, radius: float, inside: bool) -> Point | None:
    """Where an offset line ends that meets an offset arc: going out of it with the cutter inside, else coming in."""
    return _chord(point, direction, centre, radius, forward=inside)


def arc_line(centre: Point, radius: float, point: Point, direction: Point, inside: bool) -> Point | None:
    """Where an offset line begins that leaves an offset arc: coming in with the cutter inside it, else going out."""
    return _chord(point, direction, centre, radius, forward=not inside)


def arc_arc(centre: Point, radius: float, other: Point, other_radius: float, left: bool) -> Point | None:
    """Where two circles cross, left or right of the line from the first centre to the other; None where they do not."""
    apart = dist(centre, other)
    way = (radius * radius + apart * apart - other_radius * other_radius) / (2 * apart)
    square = radius * radius - way * way
    if square < 0:
        return None
    direction = unit(centre, other)
    foot = along(centre, direction, way)
    aside = (-direction[1], direction[0])
    return along(foot, aside, sqrt(square) if left else -sqrt(square))


def entry_centre(start: Point, end: Point, radial: Point) -> tuple[Point | None, float]:
    """The centre of the arc from `start` that meets `radial` at `end`, and the cosine between its chord and radius."""
    chord = (start[0] - end[0], start[1] - end[1])
    length = hypot(*chord)
    cosine = (chord[0] * radial[0] + chord[1] * radial[1]) / length if length else 0.0
    if cosine == 0:
        return None, 0.0
    return along(end, radial, length / 2 / cosine), cosine
