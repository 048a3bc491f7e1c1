"""A speed as reference: straight lines through points of time and speed, for a law that follows a velocity.

The position is the integral of the speed from 0 at t = 0, the acceleration its slope. Before the first point the speed
rises from 0 at t = 0; two points at one time are a step; after the last point its speed is kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Items, Quantity, checked
from rds.references.signal import Motion, Signal

_POINT = Items("time, s, and speed, mm/s", Quantity("time or speed"), "[time, speed], two numbers", 2)
OPTIONS = {"points": Items("points of the speed over time", _POINT, "points, each [time in s, speed in mm/s]", least=1)}
_EDGE = 1e-9  # s: a step counts as reached from so much before it, since sample times carry rounding errors


def speed(points: Sequence[Sequence[float]]) -> Signal:
    """The speed (mm/s) through `points` of [time in s, speed]. InputError for times below 0 or in the wrong order."""
    rows: tuple[tuple[float, float], ...] = checked(OPTIONS["points"], points, "points", "speed")
    times = np.array([row[0] for row in rows])
    if times[0] < 0.0 or (np.diff(times) < 0.0).any():
        raise InputError("speed: points must begin at 0 s or later, and their times must not fall; sort them by time")
    if ((times[2:] - times[:-2]) == 0.0).any():
        raise InputError("speed: three points are at one time; a step has two, the speed before it and after it")
    speeds = np.array([row[1] for row in rows])
    if times[0] > 0.0:
        times, speeds = np.append(0.0, times), np.append(0.0, speeds)
    ways = np.append(0.0, np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(times)))
    motion = partial(_motion, times=times, speeds=speeds, ways=ways)
    return Signal("speed", motion, settings={"points": [list(row) for row in rows]}, voltage=_no_voltage)


def _motion(t: np.ndarray, times: np.ndarray, speeds: np.ndarray, ways: np.ndarray) -> Motion:
    at = np.searchsorted(times, t + _EDGE, side="right") - 1  # the point before t; of a step the one after it
    following = np.minimum(at + 1, len(times) - 1)
    gap = times[following] - times[at]
    slope = np.where(gap > 0.0, (speeds[following] - speeds[at]) / np.where(gap > 0.0, gap, 1.0), 0.0)
    since = t - times[at]
    velocity = speeds[at] + slope * since
    return ways[at] + 0.5 * (speeds[at] + velocity) * since, velocity, slope


def _no_voltage(t: np.ndarray) -> np.ndarray:
    raise InputError("a signal of kind 'speed' is a reference and no voltage; give it under [reference]")
