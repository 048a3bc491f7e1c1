"""The `d` of an SVG path as polylines (SVG 2, section 9.3): all commands, absolute and relative."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import acos, ceil, cos, pi, radians, sin, sqrt

import numpy as np

from rds.core.errors import InputError
from rds.nc.shapes.curves import steps_of

_TOKEN = re.compile(r"([MmLlHhVvCcSsQqTtAaZz])|([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)|([^\s,])")
_COUNT = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
_LARGEST = 1e13  # chord errors that a radius has at most: a float's points are then a hundredth of one off


def polylines(d: str, chord_error: float, where: str) -> Iterator[tuple[np.ndarray, bool]]:
    """Each subpath as points (n × 2) and whether it is closed. `chord_error` in the path's own unit. InputError."""
    points: list[complex] = []
    start = here = 0j
    control: complex | None = None  # the last control point, for S and T
    kind = ""
    for command, v in _commands(d, where):
        upper = command.upper()
        base = here if command.islower() else 0j
        if upper == "M":
            if len(points) > 1:
                yield _rows(points), False
            start = here = base + complex(*v)
            points, control = [here], None
        elif upper == "Z":
            if points:
                yield _rows(points), True
            here, points, control = start, [start], None
        else:
            if not points:
                points = [here]
            ends, control, here = _piece(upper, v, base, here, command, control, kind, chord_error)
            points += ends
        kind = upper
    if len(points) > 1:
        yield _rows(points), False


def _commands(d: str, where: str) -> Iterator[tuple[str, list[float]]]:
    command, values, bare = "", [], False  # type: str, list[float], bool
    tokens = _split_flags(d, where)
    for word, number in tokens:
        if word:
            if values:
                raise InputError(f"path command {command} has {len(values)} numbers too few or too many", where)
            if bare:
                raise _without_numbers(command, where)
            command, bare = word, word not in "Zz"
            if command in "Zz":
                yield command, []
            continue
        if not command or command in "Zz":
            raise InputError(f"a path begins with M, not with {number:g}", where)
        values.append(number)
        bare = False
        if len(values) == _COUNT[command.upper()]:
            yield command, values
            values = []
            command = {"M": "L", "m": "l"}.get(command, command)
    if values:
        raise InputError(f"path command {command} has too few numbers; save it as plain SVG", where)
    if bare:
        raise _without_numbers(command, where)


def _without_numbers(command: str, where: str) -> InputError:
    return InputError(f"path command {command} has no numbers; save it as plain SVG", where)


def _split_flags(d: str, where: str) -> Iterator[tuple[str, float]]:
    """Commands and numbers; the two flags of an arc may stand without a blank behind them."""
    at, command, count = 0, "", 0
    flag = re.compile(r"[\s,]*([01])")
    while at < len(d):
        if command in "Aa" and command and count % 7 in (3, 4) and (match := flag.match(d, at)):
            yield "", float(match[1])
            at, count = match.end(), count + 1
            continue
        match = _TOKEN.search(d, at)
        if match is None:
            return
        if match[3]:
            raise InputError(f"{match[3]!r} in a path is neither a command nor a number", where)
        at = match.end()
        if match[1]:
            command, count = match[1], 0
            yield match[1], 0.0
        else:
            count += 1
            yield "", float(match[2])


def _piece(
    upper: str,
    v: list[float],
    base: complex,
    here: complex,
    command: str,
    control: complex | None,
    before: str,
    chord_error: float,
) -> tuple[list[complex], complex | None, complex]:
    """Points after `here`, the last control point, and the end."""
    if upper == "H":
        end = complex(v[0] + (here.real if command == "h" else 0.0), here.imag)
        return [end], None, end
    if upper == "V":
        end = complex(here.real, v[0] + (here.imag if command == "v" else 0.0))
        return [end], None, end
    if upper == "A":
        end = base + complex(v[5], v[6])
        return _arc(here, end, abs(v[0]), abs(v[1]), radians(v[2]), v[3] != 0, v[4] != 0, chord_error), None, end
    p = [base + complex(v[k], v[k + 1]) for k in range(0, len(v), 2)]
    if upper == "L":
        return p, None, p[0]
    if upper in "QT":
        mirrored = 2 * here - control if control is not None and before in ("Q", "T") else here
        c, end = (p[0], p[1]) if upper == "Q" else (mirrored, p[0])
        return bezier([here, here + 2 / 3 * (c - here), end + 2 / 3 * (c - end), end], chord_error), c, end
    mirrored = 2 * here - control if control is not None and before in ("C", "S") else here
    c0, c1, end = (p[0], p[1], p[2]) if upper == "C" else (mirrored, p[0], p[1])
    return bezier([here, c0, c1, end], chord_error), c1, end


def bezier(p: list[complex], chord_error: float) -> list[complex]:
    """Points of a cubic after its first: chords of n equal steps are off by 3/4 of the largest second difference/n²."""
    bend = max(abs(p[0] - 2 * p[1] + p[2]), abs(p[1] - 2 * p[2] + p[3]))
    n = min(max(ceil(sqrt(0.75 * bend / chord_error)), 1), 10000)
    t = np.arange(1, n + 1) / n
    u = 1.0 - t
    points = u**3 * p[0] + 3 * u * u * t * p[1] + 3 * u * t * t * p[2] + t**3 * p[3]
    return [complex(value) for value in points]


def _arc(
    here: complex, end: complex, rx: float, ry: float, tilt: float, large: bool, positive: bool, chord_error: float
) -> list[complex]:
    """An elliptical arc by its ends (SVG 2, appendix B.2.4)."""
    if rx == 0.0 or ry == 0.0 or here == end:
        return [end]
    turn = complex(cos(tilt), sin(tilt))
    half = (here - end) / 2 / turn
    x, y = half.real, half.imag
    grow = (x / rx) ** 2 + (y / ry) ** 2
    if grow > 1.0:
        rx, ry = rx * sqrt(grow), ry * sqrt(grow)
    below = (rx * y) ** 2 + (ry * x) ** 2
    root = sqrt(max((rx * ry) ** 2 / below - 1.0, 0.0)) * (1 if large != positive else -1)
    cx, cy = root * rx * y / ry, -root * ry * x / rx

    def angle(px: float, py: float) -> float:
        size = sqrt(px * px + py * py)
        return acos(max(-1.0, min(1.0, px / size))) * (1 if py >= 0 else -1)

    first = angle((x - cx) / rx, (y - cy) / ry)
    sweep = angle((-x - cx) / rx, (-y - cy) / ry) - first
    if positive and sweep < 0:
        sweep += 2 * pi
    if not positive and sweep > 0:
        sweep -= 2 * pi
    size = max(rx, ry)
    if not size < _LARGEST * chord_error:
        raise InputError(f"an arc of radius {size:g} is too large for its points to be known; correct it")
    n = steps_of(size, sweep, chord_error)
    middle = complex(cx, cy) * turn + (here + end) / 2
    along = first + sweep * np.arange(1, n) / n
    points = [middle + turn * complex(rx * cos(a), ry * sin(a)) for a in along]
    return [*points, end]


def _rows(points: list[complex]) -> np.ndarray:
    return np.array([(p.real, p.imag) for p in points])
