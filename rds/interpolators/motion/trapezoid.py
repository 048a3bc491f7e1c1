"""The trapezoidal profile: constant acceleration, constant velocity, constant deceleration to rest at the target.

three-axis-mill, "Motion Profile", figure 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, isfinite, sqrt
from numbers import Real

import numpy as np

from rds.core.errors import InputError


@dataclass(frozen=True)
class Profile:
    """Samples T s apart, from rest to rest: time s, position mm, velocity mm/s, acceleration mm/s² (each (m,))."""

    T: float
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    duration: float  # s, of the continuous motion; the last sample is at or after it


def trapezoid(distance: float, feed: float, accel: float, T: float) -> Profile:
    """A move over `distance` (mm, signed) at `feed` (mm/s) with `accel` (mm/s²), sampled every T s.

    It is a triangle where the distance is too short for the feed: v² = a·d. The last sample is at rest on the target.
    Raises InputError for a feed, acceleration or period that is not more than 0.
    """
    for name, value in (("distance", distance), ("feed", feed), ("accel", accel), ("T", T)):
        if not isinstance(value, Real):
            raise InputError(f"{name} = {value!r:.60} must be a number; each axis has a profile of its own")
    for name, value, unit in (("feed", feed, "mm/s"), ("accel", accel, "mm/s²"), ("T", T, "s")):
        if not (isfinite(value) and value > 0.0):
            raise InputError(f"{name} = {value!r} must be more than 0 ({unit})")
    if not isfinite(distance):
        raise InputError(f"distance = {distance!r} must be a finite number of mm")
    way = abs(distance)
    top = min(feed, sqrt(accel * way))
    ramp = top / accel
    steady = max(way - top * ramp, 0.0) / top if top > 0.0 else 0.0
    duration = 2.0 * ramp + steady
    t = T * np.arange(ceil(duration / T - 1e-9) + 1)
    left = np.maximum(duration - t, 0.0)  # the end mirrors the start
    rising, falling = t < ramp, left < ramp
    position = np.where(rising, 0.5 * accel * t**2, 0.5 * top * ramp + top * (t - ramp))
    position = np.where(falling & ~rising, way - 0.5 * accel * left**2, position)
    velocity = np.where(rising, accel * t, np.where(falling, accel * left, top))
    acceleration = np.where(rising, accel, np.where(falling & (left > 0.0), -accel, 0.0))
    position[-1], velocity[-1], acceleration[-1] = way, 0.0, 0.0
    sign = -1.0 if distance < 0.0 else 1.0
    return Profile(T, t, sign * position, sign * velocity, sign * acceleration, duration)
