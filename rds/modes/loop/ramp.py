"""A smooth change of the rate at which something is passed, over a whole number of sample periods; who follows it."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, floor
from typing import Any, NamedTuple

STEEPEST = 1.875  # largest slope of S(q) = 10 q³ − 15 q⁴ + 6 q⁵, at q = 1/2
SHARPEST = 5.7736  # largest second derivative of S(q): 10/√3
FURTHEST = 0.59  # periods that `landing` may add or take
EXTRA_STEEPEST = 7.52  # largest slope of B(q) = 140 q³ (1 − q)³
EXTRA_SHARPEST = 52.5  # largest second derivative of B(q), at q = 1/2

SHORTEST = 0.02  # s, of a ramp
_LONGEST = 600  # samples, of a ramp: a change that takes longer is made in steps
_FEWEST = 9  # samples of a ramp; from rest, a shorter one would go back a little to land on a sample

_UNEVEN = 2.0**0.5 - 1.0  # rounds at a place that no round rate comes to, where a last digit would decide


class Ramp(NamedTuple):
    """The rate goes from `start` to `end` in `samples` periods as S(k/samples), S(q) = 10 q³ − 15 q⁴ + 6 q⁵.

    On the way it passes `extra` periods more, by B(k/samples) extra/samples on the rate, B(q) = 140 q³ (1 − q)³.
    Slope and second derivative of the rate are 0 at both ends. `k` may be a number or an array.
    """

    start: float
    end: float
    samples: int
    extra: float = 0.0

    def rate(self, k: Any) -> Any:
        """The rate after k periods, 0 ≤ k ≤ samples."""
        q = k / self.samples
        cube, rest = q * q * q, 1.0 - q
        more = self.extra / self.samples * (140.0 * cube * rest * rest * rest)
        return self.start + (self.end - self.start) * (cube * (10.0 + q * (6.0 * q - 15.0))) + more

    def slope(self, k: Any) -> Any:
        """Change of the rate for each period, after k of them."""
        q = k / self.samples
        hill = 30.0 * q * q * (1.0 - q) * (1.0 - q)
        return hill * (self.end - self.start + self.extra / self.samples * (14.0 - 28.0 * q)) / self.samples

    def passed(self, k: Any) -> Any:
        """The integral of the rate over the first k periods, in periods."""
        q = k / self.samples
        fourth = q * q * q * q
        most = (self.end - self.start) * self.samples * (fourth * (2.5 + q * (q - 3.0)))
        return self.start * k + most + self.extra * (fourth * (35.0 + q * (q * (70.0 - 20.0 * q) - 84.0)))

    def landing(self, place: float) -> Ramp:
        """The same from `place`, in periods, to a whole number of them, at most FURTHEST further or less far."""
        end = place + self.passed(self.samples)
        return self._replace(extra=self.extra + floor(end + _UNEVEN) - end)

    def beginning_at(self, place: float) -> Ramp:
        """What it is when it begins at `place`: to a rate of 1, it ends at a sample."""
        return self.landing(place) if self.end == 1.0 else self


def in_steps(change: float, seconds: Callable[[float], float], T: float) -> tuple[float, int]:
    """The first step of a change of the rate, and how many samples of `T` s it takes.

    `seconds(size)` is what a change of that size takes at least; it grows with the size or with its root.
    """
    longest = max(_LONGEST, ceil(seconds(0.0) / T))  # no step is short enough to take less
    samples = 0
    while samples == 0 or samples > longest:
        change *= 1.0 if samples == 0 else (longest / samples) ** 2
        samples = max(ceil(seconds(abs(change)) / T), _FEWEST)
    return change, samples


class VariableRate:
    """What passes samples at a rate: `place` in samples, and the ramp that `rate` is on, if it is on one."""

    def __init__(self) -> None:
        self.place, self.rate = 0.0, 1.0
        self._ramp: Ramp | None = None
        self._k, self._from = 0, 0.0  # how far the ramp is, and where it began

    def _go_along(self, ramp: Ramp) -> None:
        """Begin a ramp."""
        self._ramp, self._k, self._from = ramp.beginning_at(self.place), 0, self.place

    def _next_place(self) -> tuple[float, float]:
        """The place one sample period on, and the slope of the rate there, per period; `rate` is the one there."""
        ramp = self._ramp
        if ramp is None:
            return self.place + self.rate, 0.0
        self._k += 1
        place = self._from + ramp.passed(self._k)
        if self._k < ramp.samples:
            self.rate = ramp.rate(self._k)
            return place, ramp.slope(self._k)
        self.rate, self._ramp = ramp.end, None
        return (float(round(place)) if ramp.end == 1.0 else place), 0.0
