"""The few statistics that all reports share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Summary(NamedTuple):
    """Statistics of readings, in the unit of the readings."""

    n: int
    mean: float
    std: float | None  # of a sample, with n - 1; None for a single reading
    low: float
    high: float
    p99: float  # 99th percentile, linear between readings

    @property
    def worst(self) -> float:
        """The largest deviation from the mean, either way."""
        return max(self.mean - self.low, self.high - self.mean)


def summary(values: Sequence[float] | np.ndarray) -> Summary:
    """Statistics of at least one reading."""
    data = np.asarray(values, dtype=float)
    std = float(data.std(ddof=1)) if len(data) > 1 else None
    return Summary(
        len(data), float(data.mean()), std, float(data.min()), float(data.max()), float(np.percentile(data, 99))
    )
