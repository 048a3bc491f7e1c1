"""The reference of an axis that is jogged: towards a goal, or to rest, within a speed and an acceleration."""

from __future__ import annotations

from math import ceil, copysign, sqrt

_ROUNDING = 1e-9


def advance(
    position: float, velocity: float, goal: float | None, speed: float, acceleration: float, T: float
) -> tuple[float, float]:
    """Position and velocity one sample of `T` s later: towards `goal`, or to rest where it is None.

    Units of the axis, s. The velocity is held from sample to sample, x' = x + T v', and changes by at most a T. Slowing
    down by a T in each, n samples from the velocity v on go n v T - n (n - 1)/2 a T²; n is the fewest that end less
    than a T above rest, so that 2 d <= n (n + 1) a T² for the way d that is left, and the last one ends on the goal.
    The goal is not passed unless it was moved nearer than that.
    """
    most = acceleration * T
    if goal is None:
        wanted = 0.0
    else:
        left = goal - position
        n = max(1, ceil(sqrt(0.25 + 2.0 * abs(left) / (most * T)) - 0.5 - _ROUNDING))
        last = left / T  # velocity that ends on the goal
        if n == 1 and abs(last) <= speed and abs(last - velocity) <= most * (1.0 + _ROUNDING):
            return goal, 0.0
        wanted = copysign(min(speed, abs(last) / n + 0.5 * (n - 1) * most), left)
    velocity = min(max(wanted, velocity - most), velocity + most)
    return position + T * velocity, velocity
