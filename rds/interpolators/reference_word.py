"""Reference word (sampled data): a recursion finds the corners of a polygon along the arc, and words walk its chords.

From corner to corner (oacs-thesis, eq. 7.35 to 7.43; dcs-thesis, eq. 3.1 and 3.2):

    X(i+1) = A X(i) - B Y(i),  Y(i+1) = A Y(i) + B X(i),  A = cos α, B = sin α

and the methods differ in what they put for A and B, and in the step angle α that keeps the polygon within one BLU
(basic length unit) of the circle: outside it at the corners (radial error ER), inside at the middle of the chords
(chord height error EH). Straight lines are walked by F T in each sample (eq. 7.27), and the residual in the last (eq.
7.29 to 7.31), and so is the polygon where the bound has room for the corners that this cuts; else the chords of an arc
are walked in equal parts of at most F T, at the velocity of eq. 7.44 and 7.45.

Here the number of steps is the smallest whose polygon stays within one BLU everywhere, and the steps are of one size
(see `division.py`); the number by the formulas of the literature is `Steps.formula`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from rds.core.geometry import length
from rds.core.quantities import Quantity
from rds.core.types import ArcSegment, Segment
from rds.interpolators.division import Division, Method, Turn, divide, least_steps
from rds.interpolators.segment import Arc, checked, samples

_HAIR = 1e-9
BLU = 0.01  # mm: mrm-control, section 8.2; dcs-thesis, eq. 5.1
OPTIONS: Mapping[str, Quantity] = {
    "blu": Quantity("basic length unit, which bounds the errors of an arc", "mm", above=0.0),
    "steps": Quantity("steps of each arc instead of as many as the bound asks for; 0: those", low=0.0, whole=True),
}
DEFAULTS = {"blu": BLU, "steps": 0.0}


@dataclass(frozen=True)
class Steps:
    """How a method took an arc: errors measured on the polygon that it made."""

    method: str
    radius: float  # mm
    sweep: float  # rad
    blu: float  # mm
    count: int
    formula: float  # steps, by the step angle of the literature
    least: int | None  # fewest steps within one BLU, whatever feed and samples; None where `steps` gives the count
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
            "least": self.least,
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
    positions = _chords(segment, T, params, method) if isinstance(segment, ArcSegment) else _words(segment, T)
    last, velocity = np.array(segment.start), None
    for position in positions:
        now = (position - last) / T
        yield position, now, (now - velocity) / T if velocity is not None else np.zeros(len(now))
        last, velocity = position, now


def steps(segment: ArcSegment, params: Mapping[str, Any], method: Method, T: float | None = None) -> Steps:
    """How `method` takes an arc sampled every `T` s, with the errors of its polygon; InputError as `interpolate`.

    Without `T`, with the fewest steps, whatever the samples.
    """
    arc = Arc.of(segment)
    turn, blu = Turn(arc.arm, arc.sweep), _blu(params)
    division = _division(arc, segment, 0.0 if T is None else T, params, method)
    n = division.steps
    points = np.fromiter(_all(turn, n, method), complex, n + 1)
    walked = np.append(points[: -1 : division.corners], points[-1])
    corners = np.abs(points) - turn.radius
    middles = np.abs(walked[1:] + walked[:-1]) / 2.0 - turn.radius
    return Steps(
        method=method.name,
        radius=turn.radius,
        sweep=abs(turn.sweep),
        blu=blu,
        count=n,
        formula=abs(turn.sweep) / method.formula(turn.radius / blu),
        least=None if params.get("steps", DEFAULTS["steps"]) else least_steps(turn, blu, method),
        radial_error=float(np.abs(corners).max()),
        chord_error=max(0.0, turn.radius - float(_nearest(walked).min())),
        mean_chord_error=-float(middles.mean()),
        corners=corners,
        middles=middles,
    )


def _words(line: Segment, T: float) -> Iterator[np.ndarray]:
    """Points F T apart along a line, and its end."""
    start, way = np.array(line.start), np.subtract(line.end, line.start)
    N = samples(line, T)
    share = line.feed_rate * T / length(line) if N else 0.0
    for k in range(1, N):
        yield start + way * (k * share)
    if N:
        yield np.array(line.end)


def _chords(segment: ArcSegment, T: float, params: Mapping[str, Any], method: Method) -> Iterator[np.ndarray]:
    """Points of the polygon: F T apart along it; or its corners, or every so many of them, and equal parts between."""
    arc = Arc.of(segment)
    division = _division(arc, segment, T, params, method)
    if division.through:
        yield from _through(segment, T, _corners(arc, segment, division, method))
        return
    here = np.array(segment.start)
    for corner in islice(_corners(arc, segment, division, method), division.corners - 1, None, division.corners):
        for part in range(1, division.samples):
            yield here + (corner - here) * (part / division.samples)
        yield corner
        here = corner
    if division.steps % division.corners:
        yield np.array(segment.end)


def _through(segment: ArcSegment, T: float, corners: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
    """Points F T apart along a polygon, and its end."""
    here, word = np.array(segment.start), segment.feed_rate * T
    left = word  # to the next point
    for corner in corners:
        ahead = float(np.linalg.norm(corner - here))
        while ahead > left * (1.0 + _HAIR):
            here = here + (corner - here) * (left / ahead)
            ahead, left = ahead - left, word
            yield here
        here, left = corner, left - ahead
    yield np.array(segment.end)


def _corners(arc: Arc, segment: ArcSegment, division: Division, method: Method) -> Iterator[np.ndarray]:
    for i, corner in enumerate(method.corners(Turn(arc.arm, arc.sweep), division.steps), start=1):
        yield arc.at(corner, i / division.steps)
    yield np.array(segment.end)


def _division(arc: Arc, segment: ArcSegment, T: float, params: Mapping[str, Any], method: Method) -> Division:
    turn = Turn(arc.arm, arc.sweep)
    around = turn.radius * abs(turn.sweep)
    way = segment.feed_rate * T * around / length(segment)  # in the plane, of a helix
    return divide(turn, way or 1e-12 * around, _blu(params), params.get("steps", DEFAULTS["steps"]), method)


def _all(turn: Turn, n: int, method: Method) -> Iterator[complex]:
    yield turn.arm
    yield from method.corners(turn, n)
    yield turn.arm * complex(np.exp(1j * turn.sweep))


def _nearest(points: np.ndarray) -> np.ndarray:
    """Distance of each chord from the centre."""
    chords = np.diff(points)
    share = np.clip(-(points[:-1] * chords.conj()).real / np.maximum(np.abs(chords) ** 2, 1e-300), 0.0, 1.0)
    return np.abs(points[:-1] + share * chords)


def _blu(params: Mapping[str, Any]) -> float:
    return float(params.get("blu", DEFAULTS["blu"]))
