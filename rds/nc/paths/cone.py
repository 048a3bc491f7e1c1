"""The spiral cone of three-axis-mill."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, cos, degrees, floor, hypot, pi, radians, sin, sqrt

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.types import ArcSegment, LineSegment, Segment
from rds.nc.paths.numbers import FEED_RATE, NOT_NEGATIVE, POSITIVE, number, point

STEP_ANGLE = 2.0  # degrees: three-axis-mill's
LARGEST_STEP = 45.0  # degrees
MOST_CHORDS = 1_000_000


def spiral_cone(
    centre: Sequence[float],
    radius: float,
    height: float,
    step_height: float,
    step_width: float,
    feed_rate: float,
    *,
    step_angle: float | None = None,
    tolerance: float | None = None,
) -> list[Segment]:
    """A circle at the bottom, then a spiral up and inwards to z = 0 (three-axis-mill, figures 33 and 34).

    `centre` x, y and `radius` of the first circle, mm; `height`: the circle lies at z = -height, mm; `step_height` and
    `step_width`: how far one turn rises and by how much it narrows, mm. The spiral is cut in chords of `step_angle`
    (2° as in the source; rounded down to a whole part of a turn), or in chords that keep within `tolerance` (mm) of
    the true spiral. `feed_rate` in mm/s. `chord_error` gives the deviation of either.

    InputError for a spiral that would come to its centre before the top, and where both step angle and tolerance are
    given. Unlike the source, the path does not begin with a cut from the origin, and the first turn is a true circle.
    """
    owner = "cone"
    x, y, _ = point(centre, "centre", owner, sizes=(2,))
    r = number(radius, "radius", owner, POSITIVE)
    depth = number(height, "height", owner, POSITIVE)
    rise = number(step_height, "step height", owner, POSITIVE)
    narrowing = number(step_width, "step width", owner, NOT_NEGATIVE)
    feed = number(feed_rate, "feed rate", owner, FEED_RATE)
    turns = depth / rise
    if narrowing * turns > r * (1 + 1e-12):
        raise InputError(
            f"cone: {turns:g} turns that narrow by {narrowing:g} mm each go past the centre of a radius of {r:g} mm; "
            f"take a step width of at most {r / turns:g} mm, or a larger step height"
        )
    per_turn = round(360.0 / chord_angle(r, narrowing, step_angle=step_angle, tolerance=tolerance))
    whole = floor(turns * per_turn + 1e-9)
    if whole > MOST_CHORDS:
        raise InputError(f"cone: {whole} chords; take a larger step height, step angle or tolerance")
    at = [k / per_turn for k in range(1, whole + 1)]
    if not at or turns - at[-1] > 1e-9:
        at.append(turns)
    at[-1] = turns  # ends at z = 0 exactly

    start = (x + r, y, -depth)
    segments: list[Segment] = [ArcSegment(start, start, (x, y, -depth), feed)]
    here = start
    for turn in at:
        now = max(r - narrowing * turn, 0.0)
        angle = 2 * pi * (turn % 1.0)
        there = (x + now * cos(angle), y + now * sin(angle), -depth + rise * turn if turn < turns else 0.0)
        segments.append(LineSegment(here, there, feed))
        here = there
    return segments


def chord_error(radius: float, step_width: float, step_angle: float) -> float:
    """How far chords of `step_angle` degrees can be from the spiral that narrows by `step_width` a turn, mm.

    A curve p(θ) is off its chord by at most max|p″|·Δθ²/8; here |p″| = √(r² + (2c)²) with c = step_width/2π, largest
    at the bottom, where r is the radius.
    """
    return hypot(radius, step_width / pi) * radians(step_angle) ** 2 / 8


def chord_angle(
    radius: float, step_width: float, *, step_angle: float | None = None, tolerance: float | None = None
) -> float:
    """Degrees that a chord of the spiral takes: a whole part of a turn, at most `step_angle`, or by the tolerance (mm).

    InputError where both are given, or one of them is out of range.
    """
    if step_angle is not None and tolerance is not None:
        raise InputError("cone: step angle and tolerance both say how long a chord is; give one of them")
    if tolerance is not None:
        allowed = number(tolerance, "tolerance", "cone", Quantity("chord error", "mm", above=0.0))
        largest = degrees(sqrt(8 * allowed / hypot(radius, step_width / pi)))
        return 360.0 / max(ceil(360.0 / largest), 8)
    step = Quantity("angle of a chord", "degrees", above=0.0).check(
        STEP_ANGLE if step_angle is None else step_angle, "step angle", "cone"
    )
    if step > LARGEST_STEP:
        raise InputError(f"cone: step angle = {step:g} must be at most {LARGEST_STEP:g} (degrees per chord)")
    return 360.0 / ceil(360.0 / step - 1e-9)
