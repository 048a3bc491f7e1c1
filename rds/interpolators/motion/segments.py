"""The programmed path: rows of dtype SEGMENT, in machine coordinates, mm and degrees.

A segment is a straight move of all axes at once (`plane` −1), or an arc or helix of X, Y, Z with the rotary axes (and
the axis normal to the plane) moving in proportion.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import atan2, hypot, inf, pi

import numpy as np

from rds.core.errors import InputError

AXES = ("X", "Y", "Z", "A", "B", "C")
LINE, XY, ZX, YZ = -1, 0, 1, 2  # planes
EXACT_PATH, EXACT_STOP, BLEND = 0, 1, 2  # modes: G61, G61.1, G64
JOINTS, MOVED, TILTED = 0, 1, 2  # of `tip`
OFF_CIRCLE, OFF_SHARE = 0.06, 0.01  # mm; of the radius: beyond what the language allows, also after compensation
FULL_CIRCLE = 1e-6  # rad; an arc shorter than this is a whole turn (LinuxCNC's CIRCLE_FUZZ)

SEGMENT = np.dtype(
    [
        ("line", "i4"),  # of the program
        ("rapid", "?"),
        ("plane", "i1"),
        ("mode", "i1"),
        ("tip", "i1"),  # JOINTS, or for the tool's tip: MOVED (length and rate in mm), TILTED (in degrees, tip at rest)
        ("start", "f8", (6,)),  # X Y Z A B C
        ("end", "f8", (6,)),
        ("centre", "f8", (3,)),  # of an arc, X Y Z; its component along the normal is not used
        ("sweep", "f8"),  # rad, + counter-clockwise seen from the positive end of the plane's normal (Z, Y, X)
        ("length", "f8"),  # mm in X, Y, Z (of a helix in three dimensions); degrees where only rotary axes move
        ("rate", "f8"),  # mm/s along the path, degrees/s where only rotary axes move; not used by rapids
        ("tolerance", "f8"),  # mm, G64 P; inf where no P was given
        ("collinear", "f8"),  # mm, G64 Q: lines nearer than this to being one are taken as one; 0 where none was given
        ("tool_length", "f8"),  # mm, of a move for the tip: how much longer the tool is than the machine's own
    ],
    align=True,
)

_IN_PLANE = ((0, 1, 2), (2, 0, 1), (1, 2, 0))  # first, second axis and normal of XY, ZX, YZ


def in_plane(plane: int) -> tuple[int, int, int]:
    """First axis, second axis and normal of an arc's plane, as indices."""
    return _IN_PLANE[plane]


def line(
    start: Sequence[float],
    end: Sequence[float],
    rate: float,
    *,
    rapid: bool = False,
    mode: int = EXACT_PATH,
    tolerance: float = inf,
    collinear: float = 0.0,
    program_line: int = 0,
) -> np.ndarray:
    """A straight move (array of one SEGMENT). Positions may leave out axes at the end; `rate` in mm/s or degrees/s."""
    row = _row(start, end, rate, mode, tolerance, collinear, program_line)
    row["plane"], row["rapid"] = LINE, rapid
    row["length"] = length_of_line(row["start"][0], row["end"][0])
    return row


def arc(
    start: Sequence[float],
    end: Sequence[float],
    centre: Sequence[float],
    rate: float,
    *,
    clockwise: bool = False,
    turns: int = 0,
    plane: int = XY,
    mode: int = EXACT_PATH,
    tolerance: float = inf,
    program_line: int = 0,
) -> np.ndarray:
    """An arc or helix (array of one SEGMENT) about `centre` (X, Y, Z, or the first of them).

    `clockwise` is seen from the positive end of the plane's normal; `turns` are whole turns more; an end that is seen
    from the centre where the start is, to FULL_CIRCLE, is a full circle. Raises InputError when start or end is on the
    centre, or the end is off the circle by more than OFF_CIRCLE and OFF_SHARE.
    """
    row = _row(start, end, rate, mode, tolerance, 0.0, program_line)
    row["plane"] = plane
    with _numbers():
        row["centre"][0, : len(centre)] = centre
    first, second, normal = in_plane(plane)
    a, b, c = row["start"][0], row["end"][0], row["centre"][0]
    from_centre = (a[first] - c[first], a[second] - c[second])
    to_centre = (b[first] - c[first], b[second] - c[second])
    radius = hypot(*from_centre)
    if radius == 0.0 or hypot(*to_centre) == 0.0:
        raise InputError(f"an arc from {tuple(a)} to {tuple(b)} has its centre {tuple(c)} on an end; move the centre")
    off = abs(hypot(*to_centre) - radius)
    if off > OFF_CIRCLE and off > OFF_SHARE * radius:
        raise InputError(
            f"the end {tuple(end)} of an arc is {hypot(*to_centre):.4f} mm from its centre {tuple(centre)}, and its "
            f"start {tuple(start)} is {radius:.4f} mm from it; an arc is given by start, end and centre, in this order"
        )
    sign = -1.0 if clockwise else 1.0
    angle = atan2(to_centre[1], to_centre[0]) - atan2(from_centre[1], from_centre[0])
    sweep = (sign * angle) % (2 * pi)
    sweep += 2 * pi * ((sweep < FULL_CIRCLE) + turns)
    row["sweep"] = sign * sweep
    row["length"] = hypot(radius * sweep, b[normal] - a[normal])
    return row


def length_of_line(start: np.ndarray, end: np.ndarray) -> float:
    """mm in X, Y, Z; degrees where only rotary axes move."""
    way = np.asarray(end) - np.asarray(start)
    return float(np.sqrt(np.sum(way[:3] ** 2)) or np.sqrt(np.sum(way[3:] ** 2)))


def point_at(segment: np.ndarray, distance: float) -> np.ndarray:
    """Where the programmed path is, `distance` mm (degrees) after the start of `segment` (one row): 6 positions."""
    share = distance / segment["length"] if segment["length"] > 0.0 else 1.0
    return points_at(np.array([segment], SEGMENT), np.array([share]))[0]


def points_at(segments: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Positions (n, 6) of the programmed path at the share (n,) of the way of each of n segments.

    On an arc whose end is a little off its circle the radius stays and the difference is spread along it, so that
    the path ends on the programmed end.
    """
    start, way = segments["start"], segments["end"] - segments["start"]
    found: np.ndarray = start + share[:, None] * way
    for plane in (XY, ZX, YZ):
        some = np.flatnonzero(segments["plane"] == plane)
        if not len(some):
            continue
        first, second, _ = in_plane(plane)
        arm = start[some][:, [first, second]] - segments["centre"][some][:, [first, second]]
        whole = segments["sweep"][some]
        off = way[some][:, [first, second]] - _turned(arm, whole)
        turned = _turned(arm, share[some] * whole) + share[some, None] * off
        found[some[:, None], [first, second]] = start[some][:, [first, second]] + turned
    found[share == 1.0] = segments["end"][share == 1.0]
    return found


def pieces(count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each piece of segments cut into `count` (n,) equal ones: whose it is, and the share of the way to its end."""
    owner = np.repeat(np.arange(len(count)), count)
    first = np.cumsum(count) - count
    return owner, (np.arange(len(owner)) - first[owner] + 1) / count[owner]


def _turned(arm: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """What turning by `angle` adds to `arm` (n, 2), without cancellation."""
    lost = 2.0 * np.sin(angle / 2.0)[:, None] ** 2  # 1 − cos
    across = np.column_stack((-arm[:, 1], arm[:, 0]))
    made: np.ndarray = np.sin(angle)[:, None] * across - lost * arm
    return made


def chain(*segments: np.ndarray) -> np.ndarray:
    """Segments one after the other, as one array."""
    if any(getattr(each, "dtype", None) != SEGMENT for each in segments):
        raise InputError("chain takes moves one by one, as in chain(line(...), arc(...)); of a list, chain(*moves)")
    return np.concatenate(segments) if segments else np.empty(0, SEGMENT)


def _row(
    start: Sequence[float],
    end: Sequence[float],
    rate: float,
    mode: int,
    tolerance: float,
    collinear: float,
    program_line: int,
) -> np.ndarray:
    row = np.zeros(1, SEGMENT)
    with _numbers():
        row["start"][0, : len(start)] = start
        row["end"][0, : len(end)] = end
        row["rate"], row["mode"], row["tolerance"], row["collinear"] = rate, mode, tolerance, collinear
        row["line"] = program_line
    # as the row has them: None is NaN there
    if not (row["mode"][0] in (EXACT_PATH, EXACT_STOP, BLEND) and row["tolerance"] >= 0.0 and row["collinear"] >= 0.0):
        said = f"mode = {mode!r}, tolerance = {tolerance!r} and collinear = {collinear!r} of a move"
        raise InputError(f"{said}: the mode is 0 (G61), 1 (G61.1) or 2 (BLEND, G64), the others are at least 0 mm")
    return row


@contextmanager
def _numbers() -> Iterator[None]:
    try:
        yield
    except (TypeError, ValueError) as error:
        raise InputError(
            "a move has a start, an end and, of an arc, a centre, each of up to six positions (mm, degrees; of the "
            f"centre three), then its rate in mm/s, and a mode that is a number, such as BLEND: {error}"
        ) from None
