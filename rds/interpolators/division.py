"""How many steps an arc is divided into by reference word, and how samples and steps go together.

Where the bound has room for it, samples are taken every so much along the polygon, whatever its corners: the straight
way from one sample to the next is then inside the polygon by at most the height of a chord of that length, and the
number of steps is the fewest, at any feed. So it is with Euler and improved Euler, whose many steps use up the bound
outside of the circle. Else a sample is taken at every corner, and between corners at equal parts of the chord: what
holds for the polygon then holds for the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import acos, ceil, cos, floor, pi, sin, sqrt
from typing import Any, NamedTuple

from rds.core.errors import InputError

_LARGEST = pi / 2  # rad, of a step
_MOST = 3_000_000  # steps of an arc
_SLOWER = 1.01  # how much time the fewest steps may cost; else more steps are taken
_DEPTH = 0.75  # of the bound, that the chord of a sample over several steps may use up
_HAIR = 1e-9


class Turn(NamedTuple):
    """What a method needs to know of an arc: the way from its centre to its start, and the angle that it goes on."""

    arm: complex  # mm
    sweep: float  # rad, + counter-clockwise

    @property
    def radius(self) -> float:
        """mm."""
        return abs(self.arm)


@dataclass(frozen=True)
class Method:
    """One way of finding the corners.

    `formula(R)` is the step angle of the literature, rad, for a radius in BLU; `deviation(turn, n)` the largest
    distance from the circle with `n` steps, mm, not growing with n; `corners(turn, n)` finds the n - 1 corners between
    start and end, relative to the centre. Where steps differ in size, `widest(turn, n)` is the widest angle, rad.
    `least(turn, bound)` is the smallest n within a bound (mm), where that has a closed form. `inside(turn, n)` is how
    far the polygon reaches inside of the circle, mm, where that is less than the deviation.
    """

    name: str
    formula: Callable[[float], float]
    deviation: Callable[[Turn, int], float]
    corners: Callable[[Turn, int], Iterator[complex]]
    widest: Callable[[Turn, int], float] = lambda turn, n: abs(turn.sweep) / n
    least: Callable[[Turn, float], int] | None = None
    inside: Callable[[Turn, int], float] | None = None


class Division(NamedTuple):
    """`steps` of an arc, each walked in `samples` of equal length, or `corners` of them walked in one sample.

    `through`: samples are equally far apart along the polygon instead, and need not be at corners.
    """

    steps: int
    samples: int = 1
    corners: int = 1
    through: bool = False


def divide(turn: Turn, way: float, blu: float, given: float, method: Method) -> Division:
    """The fewest steps within `blu` (mm) of the circle that go with samples `way` mm apart along it; or `given` steps.

    InputError for a number of steps that can't be, and where the chord of one sample is too far inside the arc.
    """
    around = turn.radius * abs(turn.sweep)
    if given:
        n = _checked(given, turn, method)
        reach = turn.radius * method.widest(turn, n)
        if reach >= way * (1.0 - _HAIR):
            return Division(n, samples=ceil(reach / way - _HAIR))
        return Division(n, corners=floor(way / reach + _HAIR))
    n = least_steps(turn, blu, method)
    height = way * way / (8.0 * turn.radius)
    if method.inside is not None and height < blu:
        within = n if method.inside(turn, n) + height <= blu else least_steps(turn, blu - height, method)
        if within <= _SLOWER * n:
            return Division(within, through=True)
    reach = turn.radius * method.widest(turn, n)
    if reach < way * (1.0 - _HAIR):
        N = ceil(around / way - _HAIR)
        depth = turn.radius * (1.0 - cos(0.5 * turn.sweep / N))
        if depth > _DEPTH * blu:
            raise _too_fast(turn, way, reach, blu)
        each = ceil(least_steps(turn, blu - depth, method) / N)
        return Division(each * N, corners=each)
    fewest = Division(n, samples=ceil(reach / way - _HAIR))
    m = floor(reach / way + _HAIR)
    n = max(n, ceil(around / (m * way) - _HAIR))
    while turn.radius * method.widest(turn, n) > m * way * (1.0 + _HAIR):
        n += 1
    return fewest if fewest.steps * fewest.samples <= _SLOWER * n * m else Division(n, samples=m)


def least_steps(turn: Turn, bound: float, method: Method) -> int:
    """The smallest number of steps that stay within `bound` mm of the circle; InputError for one out of all measure."""
    fewest = _fewest(turn)
    if method.least is not None:
        return max(fewest, method.least(turn, bound))
    low, high = fewest - 1, fewest
    while method.deviation(turn, high) > bound:
        low, high = high, 2 * high
        if high > 2 * _MOST:
            raise InputError(
                f"{method.name}: an arc of {turn.radius:g} mm within {bound:g} mm needs more than {_MOST} steps; "
                f"use improved-tustin, or a larger blu"
            )
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if method.deviation(turn, middle) <= bound else (middle, high)
    return high


def rotated(turn: Turn, factor: complex, count: int) -> Iterator[complex]:
    """The recursion itself: `count` corners, each the one before times A + i B (eq. 7.40 and 7.41)."""
    corner = turn.arm
    for _ in range(count):
        corner *= factor
        yield corner


def grown(radius: float, growth: float, angle: float, n: int) -> float:
    """Largest distance from the circle of `n` steps of `angle` rad that each make the radius `growth` times longer.

    The last corner is the end itself, on the circle. No chord is farther inside than the first, from R to growth R,
    whose nearest point to the centre is between its ends unless growth cos(angle) > 1.
    """
    if n == 1:
        return radius * (1.0 - cos(0.5 * angle))
    return radius * max(growth ** (n - 1) - 1.0, 1.0 - grown_nearest(growth, angle))


def grown_nearest(growth: float, angle: float) -> float:
    """How near a chord from the radius 1 to `growth`, `angle` rad on, comes to the centre."""
    chord = sqrt(1.0 + growth * growth - 2.0 * growth * cos(angle))
    return growth * abs(sin(angle)) / chord if growth * cos(angle) < 1.0 else 1.0


def check_steps(value: Any, owner: str) -> None:
    """InputError unless `value` is a whole number of steps."""
    if value != int(value) or value > _MOST:
        raise InputError(f"{owner}: steps = {value:g} must be a whole number up to {_MOST}; 0: by the bound")


def _checked(given: float, turn: Turn, method: Method) -> int:
    check_steps(given, method.name)
    if given < _fewest(turn):
        raise InputError(
            f"{method.name}: steps = {given:g} is less than a step each 90°; the arc needs {_fewest(turn)}"
        )
    return int(given)


def _fewest(turn: Turn) -> int:
    return max(1, ceil(abs(turn.sweep) / _LARGEST - _HAIR))


def _too_fast(turn: Turn, way: float, reach: float, blu: float) -> InputError:
    inside = min(1.0, _DEPTH * blu / turn.radius)
    longest = max(reach, 2.0 * turn.radius * acos(1.0 - inside))
    return InputError(
        f"{way:.4g} mm in one sample is a chord too far inside an arc of {turn.radius:.4g} mm for the promise of one "
        f"BLU ({blu:g} mm); {longest:.4g} mm is possible: lower the feed rate to {100 * longest / way:.3g} % of it, or "
        f"shorten the sample period"
    )
