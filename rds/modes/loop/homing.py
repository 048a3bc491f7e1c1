"""The way home of a program that was ended where it is: up first, then straight, at rest in between."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from rds.modes.loop.ramp import SHARPEST, STEEPEST, Ramp


class AxisMotion(NamedTuple):
    """What the axes should do at a sample: mm, mm/s, mm/s² (degrees), in their order."""

    position: list[float]
    velocity: list[float]
    acceleration: list[float]


class Homing:
    """From `here` to `home` within `limits` (3 × n: velocity, acceleration, jerk); the axis number `z` goes up first.

    Each leg is passed by 10 q³ − 15 q⁴ + 6 q⁵ of its length with half of every limit, so that the rate at which it is
    passed can be brought to 0 and back by ramps of `_ramp_samples` anywhere, within the limits.
    """

    def __init__(self, here: Sequence[float], home: Sequence[float], z: int | None, limits: np.ndarray, T: float):
        self.rate = 1.0
        self.legs: list[tuple[list[float], list[float], float]] = []  # start, end, seconds
        self._T, self._ramp, self._k = T, Ramp(1.0, 1.0, 1), 1
        self._place = self._from = 0.0  # s
        self._samples = _ramp_samples(limits, T)
        first, last = list(here), list(home)
        if z is not None and last[z] > first[z]:
            up = [*first[:z], last[z], *first[z + 1 :]]
            self.legs.append((first, up, leg(first, up, limits)))
            first = up
        if first != last:
            self.legs.append((first, last, leg(first, last, limits)))

    def advance(self, is_wanted: bool) -> AxisMotion:
        """One sample period, towards rest or on; only while there are legs."""
        start, end, lasts = self.legs[0]
        T, slope = self._T, 0.0
        if self._k == self._ramp.samples and self.rate != float(is_wanted):
            self._ramp, self._k, self._from = Ramp(self.rate, float(is_wanted), self._samples), 0, self._place
        if self._k < self._ramp.samples:
            self._k += 1
            self.rate, slope = self._ramp.rate(self._k), self._ramp.slope(self._k) / T
            if self._k == self._ramp.samples:
                self.rate, slope = self._ramp.end, 0.0
            place = self._from + T * self._ramp.passed(self._k)
        else:
            place = self._place + T * self.rate
        if place >= lasts:
            self.legs.pop(0)
            self._place, self._from = 0.0, -T * self._ramp.passed(self._k)  # the axes rest here: the ramp may go on
            return AxisMotion(end, [0.0] * len(end), [0.0] * len(end))
        self._place = place
        q, rate = place / lasts, self.rate
        part = q * q * q * (10.0 + q * (6.0 * q - 15.0))
        speed = 30.0 * q * q * (1.0 - q) * (1.0 - q) / lasts
        push = 60.0 * q * (1.0 - q) * (1.0 - 2.0 * q) / (lasts * lasts)
        ways = [b - a for a, b in zip(start, end, strict=True)]
        return AxisMotion(
            [a + way * part for a, way in zip(start, ways, strict=True)],
            [way * speed * rate for way in ways],
            [way * (push * rate * rate + speed * slope) for way in ways],
        )


def leg(start: Sequence[float], end: Sequence[float], limits: np.ndarray) -> float:
    """Seconds that a straight move takes by the polynomial 10 q³ − 15 q⁴ + 6 q⁵, half of each limit being used.

    Its velocity, acceleration and jerk are at most 15/8 d/D, 10/√3 d/D² and 60 d/D³ over a distance d.
    """
    way = 2.0 * np.abs(np.asarray(end) - np.asarray(start))
    velocity, acceleration, jerk = limits
    lasts = np.concatenate(
        (STEEPEST * way / velocity, np.sqrt(SHARPEST * way / acceleration), np.cbrt(60.0 * way / jerk))
    )
    return float(lasts.max(initial=0.0))


def _ramp_samples(limits: np.ndarray, T: float) -> int:
    """Periods of a ramp of the rate D s long that keeps the limits V, A, J anywhere on a leg that uses half of them.

    r² a + ṙ v is at most A/2 + 15/8 V/2D, and r³ j + 3 r ṙ a + r̈ v at most J/2 + 3·15/8 A/2D + 10/√3 V/2D².
    """
    least = 0.0
    for V, A, J in limits.T.tolist():
        b = 3.0 * STEEPEST * A
        least = max(least, STEEPEST * V / A, (b + sqrt(b * b + 4.0 * SHARPEST * V * J)) / (2.0 * J))
    return ceil(least / T)
