"""Reference word (sampled data): a recursion finds the corners of a polygon along the arc, and words walk its chords.

From corner to corner (oacs-thesis, eq. 7.35 to 7.43; dcs-thesis, eq. 3.1 and 3.2):

    X(i+1) = A X(i) - B Y(i),  Y(i+1) = A Y(i) + B X(i),  A = cos α, B = sin α

and the methods differ in what they put for A and B, and in the step angle α that keeps the polygon within one BLU
(basic length unit) of the circle: outside it at the corners (radial error ER), inside at the middle of the chords
(chord height error EH). Straight pieces are walked by F T in each sample (eq. 7.27), and the residual in the last
(eq. 7.29 to 7.31).

Here the number of steps is the smallest whose polygon stays within one BLU everywhere, and the steps are of one size;
the formulas of the literature, rounded, are `Steps.formula`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import ceil, cos, inf, pi
from typing import Any, NamedTuple

import numpy as np

from rds.core.errors import InputError
from rds.core.options import Option
from rds.core.types import ArcSegment, Segment
from rds.interpolators.segment import Arc, checked

BLU = 0.01  # mm: mrm-control, section 8.2; dcs-thesis, eq. 5.1
OPTIONS: Mapping[str, Option] = {
    "blu": Option("basic length unit, which bounds the errors of an arc, mm", more_than=0.0),
    "steps": Option("steps of each arc instead of as many as the bound asks for; 0: those", at_least=0.0),
}
DEFAULTS = {"blu": BLU, "steps": 0.0}
_LARGEST = pi / 2  # rad, of a step
_MOST = 3_000_000  # steps of an arc
_HAIR = 1e-9  # of a piece: a sample that lands on its end


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
    distance from the circle with `n` steps, mm, not growing with n; `corners(turn, n)` finds the n - 1 corners
    between start and end, relative to the centre; `least(turn, bound)` the smallest n within a bound, where that has
    a closed form.
    """

    name: str
    formula: Callable[[float], float]
    deviation: Callable[[Turn, int], float]
    corners: Callable[[Turn, int], Iterator[complex]]
    least: Callable[[Turn, float], int] | None = None


@dataclass(frozen=True)
class Steps:
    """How a method took an arc: errors measured on the polygon that it made."""

    method: str
    radius: float  # mm
    sweep: float  # rad
    blu: float  # mm
    count: int
    formula: float  # steps, by the step angle of the literature
    radial_error: float  # mm: of the corners, inside or outside
    chord_error: float  # mm: how far the chords reach inside the circle
    mean_chord_error: float  # mm: of the middles of the chords, + inside
    corners: np.ndarray = field(repr=False)  # mm: of each corner, start and end with them, + outside
    middles: np.ndarray = field(repr=False)  # mm: of the middle of each chord, + outside

    @property
    def within(self) -> bool:
        """Whether both errors are within one BLU (to a millionth of it)."""
        return max(self.radial_error, self.chord_error) <= self.blu * (1.0 + 1e-6)

    def to_json(self) -> dict[str, Any]:
        """All but the errors of the single steps."""
        return {
            "method": self.method,
            "radius_mm": self.radius,
            "sweep_rad": self.sweep,
            "blu_mm": self.blu,
            "count": self.count,
            "formula": self.formula,
            "radial_error_mm": self.radial_error,
            "chord_error_mm": self.chord_error,
            "mean_chord_error_mm": self.mean_chord_error,
            "within": self.within,
        }


def interpolate(
    segment: Segment, T: float, params: Mapping[str, Any], method: Method
) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows (mm, mm/s, mm/s²) every `T` s; velocity and acceleration are the differences of position over T.

    Raises InputError for a segment that can't be interpolated, and where one sample's way is a chord that is more than
    one BLU inside the arc.
    """
    segment = checked(segment, T)
    way = segment.feed_rate * T
    corners: Iterable[np.ndarray]
    if isinstance(segment, ArcSegment):
        arc = Arc.of(segment)
        _check_feed(arc.radius, segment.feed_rate, T, _blu(params))
        corners = _corners(arc, segment, method, params)
    else:
        corners = [np.array(segment.end)] if segment.end != segment.start else []
    last, velocity = np.array(segment.start), None
    for position in walk(last, corners, way):
        now = (position - last) / T
        yield position, now, (now - velocity) / T if velocity is not None else np.zeros(len(now))
        last, velocity = position, now


def walk(start: np.ndarray, corners: Iterable[np.ndarray], way: float) -> Iterator[np.ndarray]:
    """Points every `way` mm along the straight pieces from `start` over `corners`, and the last corner (residual)."""
    here, due, point = start, way, start
    for corner in corners:
        piece = corner - here
        size = float(np.sqrt(piece @ piece))
        while due < size * (1.0 - _HAIR):
            point = here + piece * (due / size)
            yield point
            due += way
        due -= size
        here = corner
        if due <= _HAIR * way:  # it lands on the corner
            point = corner
            yield point
            due += way
    if point is not here:
        yield here


def steps(segment: ArcSegment, params: Mapping[str, Any], method: Method) -> Steps:
    """How `method` takes an arc, with the errors of its polygon; InputError as `interpolate`."""
    arc = Arc.of(segment)
    turn, blu = Turn(arc.arm, arc.sweep), _blu(params)
    n = _count(turn, params, method)
    points = np.fromiter(_all(turn, n, method), complex, n + 1)
    corners = np.abs(points) - turn.radius
    middles = np.abs(points[1:] + points[:-1]) / 2.0 - turn.radius
    return Steps(
        method=method.name,
        radius=turn.radius,
        sweep=abs(turn.sweep),
        blu=blu,
        count=n,
        formula=abs(turn.sweep) / method.formula(turn.radius / blu),
        radial_error=float(np.abs(corners).max()),
        chord_error=max(0.0, turn.radius - float(_nearest(points).min())),
        mean_chord_error=-float(middles.mean()),
        corners=corners,
        middles=middles,
    )


def rotated(turn: Turn, factor: complex, count: int) -> Iterator[complex]:
    """The recursion itself: `count` corners, each the one before times A + i B (eq. 7.40 and 7.41)."""
    corner = turn.arm
    for _ in range(count):
        corner *= factor
        yield corner


def grown(radius: float, growth: float, angle: float, n: int) -> float:
    """Largest distance from the circle of `n` steps of `angle` rad that each make the radius `growth` times longer.

    The last corner is the end itself; chords from a corner outside are less far inside than the first.
    """
    return max(radius * (growth ** (n - 1) - 1.0), radius * (1.0 - cos(0.5 * angle)))


def least_steps(turn: Turn, bound: float, method: Method) -> int:
    """The smallest number of steps that stay within `bound` mm of the circle; InputError for one out of all measure."""
    fewest = max(1, ceil(abs(turn.sweep) / _LARGEST - 1e-9))
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


def _corners(arc: Arc, segment: ArcSegment, method: Method, params: Mapping[str, Any]) -> Iterator[np.ndarray]:
    turn = Turn(arc.arm, arc.sweep)
    n = _count(turn, params, method)
    for i, corner in enumerate(method.corners(turn, n), start=1):
        yield arc.at(corner, i / n)
    yield np.array(segment.end)


def _all(turn: Turn, n: int, method: Method) -> Iterator[complex]:
    yield turn.arm
    yield from method.corners(turn, n)
    yield turn.arm * complex(np.exp(1j * turn.sweep))


def _nearest(points: np.ndarray) -> np.ndarray:
    """Distance of each chord from the centre."""
    chords = np.diff(points)
    share = np.clip(-(points[:-1] * chords.conj()).real / np.maximum(np.abs(chords) ** 2, 1e-300), 0.0, 1.0)
    return np.abs(points[:-1] + share * chords)


def _count(turn: Turn, params: Mapping[str, Any], method: Method) -> int:
    given = params.get("steps", DEFAULTS["steps"])
    if not given:
        return least_steps(turn, _blu(params), method)
    if given != int(given) or given > _MOST:
        raise InputError(f"{method.name}: steps = {given!r} must be a whole number up to {_MOST}; 0: by the bound")
    fewest = ceil(abs(turn.sweep) / _LARGEST - 1e-9)
    if given < fewest:
        raise InputError(f"{method.name}: steps = {given:g} is less than a step each 90°; the arc needs {fewest}")
    return int(given)


def _blu(params: Mapping[str, Any]) -> float:
    return float(params.get("blu", DEFAULTS["blu"]))


def _check_feed(radius: float, feed_rate: float, T: float, blu: float) -> None:
    fastest = np.sqrt(max(0.0, 8.0 * radius * blu - 4.0 * blu**2)) / T if blu < radius else inf
    if feed_rate > fastest * (1.0 + 1e-9):
        raise InputError(
            f"feed rate {feed_rate:g} mm/s goes {feed_rate * T:g} mm in a sample of {T:g} s; a chord of that length is "
            f"more than one BLU ({blu:g} mm) inside an arc of {radius:g} mm; feed at {fastest:.4g} mm/s or less, or "
            f"shorten the sample period"
        )
