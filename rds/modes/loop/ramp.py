"""A smooth change of the rate at which something is passed, over a whole number of sample periods."""

from __future__ import annotations

from math import floor
from typing import Any, NamedTuple

STEEPEST = 1.875  # largest slope of S(q) = 10 q³ − 15 q⁴ + 6 q⁵, at q = 1/2
SHARPEST = 5.7736  # largest second derivative of S(q): 10/√3
FURTHEST = 0.59  # periods that `landing` may add or take
EXTRA_STEEPEST = 7.52  # largest slope of B(q) = 140 q³ (1 − q)³
EXTRA_SHARPEST = 52.5  # largest second derivative of B(q), at q = 1/2

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
