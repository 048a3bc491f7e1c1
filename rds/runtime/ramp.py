"""A smooth change of the rate at which something is passed, over a whole number of sample periods."""

from __future__ import annotations

from typing import Any, NamedTuple

STEEPEST = 1.875  # largest slope of S(q) = 10 q³ − 15 q⁴ + 6 q⁵, at q = 1/2
SHARPEST = 5.7736  # largest second derivative of S(q): 10/√3


class Ramp(NamedTuple):
    """The rate goes from `start` to `end` in `samples` periods as S(k/samples), S(q) = 10 q³ − 15 q⁴ + 6 q⁵.

    Slope and second derivative of the rate are 0 at both ends. `k` may be a number or an array.
    """

    start: float
    end: float
    samples: int

    def rate(self, k: Any) -> Any:
        """The rate after k periods, 0 ≤ k ≤ samples."""
        q = k / self.samples
        return self.start + (self.end - self.start) * (q * q * q * (10.0 + q * (6.0 * q - 15.0)))

    def slope(self, k: Any) -> Any:
        """Change of the rate for each period, after k of them."""
        q = k / self.samples
        return (self.end - self.start) * (30.0 * q * q * (1.0 - q) * (1.0 - q)) / self.samples

    def passed(self, k: Any) -> Any:
        """The integral of the rate over the first k periods, in periods."""
        q = k / self.samples
        return self.start * k + (self.end - self.start) * self.samples * (q * q * q * q * (2.5 + q * (q - 3.0)))
