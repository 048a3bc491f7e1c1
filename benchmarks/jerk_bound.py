"""A bound on the time of a path that has the limit on jerk where it is known in closed form: on straight lines.

The least time without jerk (rds/interpolators/motion/least_time.py) gives the highest speed at each end of a piece.
From the one to the other a straight line takes at least the jerk-limited motion of one axis (what ruckig gives), whose
acceleration at both ends is free, but 0 where the path is at rest. Arcs and blends count as without jerk, so no motion
along the path is faster.

With `in_blends` no blend is passed faster than at the constant speed that its jerk allows. That is an estimate, and no
bound: a motion may be faster where its speed changes in the blend.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from rds.interpolators.motion.least_time import FROM, HIGHEST, WAY, _backward, _forward, intervals
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.pieces import BLENDED, FEED, KIND, REST, STRAIGHT, TWIST

_HALVINGS = 80


def least_with_jerk(f: np.ndarray, u: np.ndarray, limits: Limits, T: float, in_blends: bool = False) -> float:
    """s, of all pieces (rows of pieces.py), which begin and end at rest."""
    if in_blends:
        f, blends = f.copy(), u[:, KIND] == BLENDED
        with np.errstate(divide="ignore"):
            speeds = np.cbrt(np.where(limits.jerk > 0.0, limits.jerk, inf) / f[:, TWIST : TWIST + 6]).min(axis=1)
        f[blends, FEED] = np.minimum(f[blends, FEED], speeds[blends])
    total, first = 0.0, 0
    rests = np.flatnonzero(u[:, REST])
    for last in (*rests.tolist(), *([] if len(rests) and rests[-1] == len(u) - 1 else [len(u) - 1])):
        total += _stretch(f[first : last + 1], u[first : last + 1], limits, T)
        first = last + 1
    return total


def _stretch(f: np.ndarray, u: np.ndarray, limits: Limits, T: float) -> float:
    """s, from rest to rest."""
    rows, counts = intervals(f, u, limits.velocity, limits.acceleration, T)
    top = _backward(rows, limits.acceleration, 0.0)
    total, x, at = 0.0, 0.0, 0
    for k, count in enumerate(counts.tolist()):
        part = rows[at : at + count]
        ended, seconds = _forward(part, limits.acceleration, top[at : at + count + 1], x, count)
        if u[k, KIND] == STRAIGHT:
            slopes = np.abs(part[0, FROM : FROM + 6])
            moving = slopes > 0.0
            a, j = (float((most[moving] / slopes[moving]).min()) for most in (limits.acceleration, limits.jerk))
            most = sqrt(part[0, HIGHEST])
            line = straight(part[0, WAY], sqrt(x), sqrt(ended), most, a, j, k == 0, k == len(counts) - 1)
            seconds = max(seconds, line)
        total, x, at = total + seconds, ended, at + count
    return total


def straight(
    way: float, v: float, w: float, most: float, a: float, j: float, from_rest: bool = False, to_rest: bool = False
) -> float:
    """s of a line from speed v to speed w, with at most these speeds at its ends, speed `most`, acceleration a, jerk j.

    Where the line is too short to reach a highest speed in it: what it takes to run up from rest, if it begins so.
    """

    def there(peak: float) -> tuple[float, float]:
        up, down = _run_up(v, peak, a, j, from_rest), _run_up(w, peak, a, j, to_rest)
        return up[0] + down[0], up[1] + down[1]

    low, high = max(v, w), most
    if low > high or there(low)[1] > way:
        return max(_from_rest(way, a, j) if rest else 0.0 for rest in (from_rest, to_rest))
    seconds, covered = there(high)
    if covered <= way:
        return seconds + (way - covered) / high
    for _ in range(_HALVINGS):
        peak = 0.5 * (low + high)
        low, high = (peak, high) if there(peak)[1] < way else (low, peak)
    return there(low)[0]


def _run_up(v: float, peak: float, a: float, j: float, at_rest: bool) -> tuple[float, float]:
    """Seconds and way from speed v to a highest speed, where the acceleration is 0; at v it is free, unless at rest."""
    gain = peak - v
    if gain <= 0.0:
        return 0.0, 0.0
    if at_rest:
        seconds = 2.0 * sqrt(gain / j) if gain <= a * a / j else gain / a + a / j
        return seconds, 0.5 * (v + peak) * seconds
    ramp = min(sqrt(2.0 * gain / j), a / j)
    even = max(gain - 0.5 * a * a / j, 0.0) / a
    return even + ramp, v * even + 0.5 * a * even * even + peak * ramp - j * ramp**3 / 6.0


def _from_rest(way: float, a: float, j: float) -> float:
    """s for the way from rest with acceleration 0, however fast it ends."""
    if way <= a**3 / (6.0 * j * j):
        return float((6.0 * way / j) ** (1.0 / 3.0))
    rest, speed = way - a**3 / (6.0 * j * j), 0.5 * a * a / j
    return a / j + (sqrt(speed * speed + 2.0 * a * rest) - speed) / a if a < inf else 0.0
