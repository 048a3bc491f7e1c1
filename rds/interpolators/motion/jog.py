"""The reference of an axis that is jogged: towards a goal, or to rest, within a speed and an acceleration."""

from __future__ import annotations

from math import copysign, sqrt


def advance(
    position: float, velocity: float, goal: float | None, speed: float, acceleration: float, T: float
) -> tuple[float, float]:
    """Position and velocity one sample of `T` s later: towards `goal`, or to rest where it is None.

    Units of the axis, s. The velocity is held from sample to sample, x' = x + T v', and changes by at most a T. From
    the speed n a T it takes n (n + 1)/2 a T² to stop; so n solves n² + n = 2 d/(a T²) for the way d that is left.
    The goal is not passed unless it was moved nearer than that.
    """
    most = acceleration * T
    if goal is None:
        wanted = 0.0
    else:
        left = goal - position
        samples = sqrt(0.25 + 2.0 * abs(left) / (most * T)) - 0.5
        if samples <= 1.0 and abs(velocity) <= 2.0 * most and abs(left) <= speed * T:
            return goal, 0.0
        wanted = copysign(min(speed, most * samples), left)
    velocity = min(max(wanted, velocity - most), velocity + most)
    return position + T * velocity, velocity
