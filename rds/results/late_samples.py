"""Which samples of a run were late, from the times in its table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rds.results.result import Result

STAGES = ("lateness", "io", "interpolate", "compute", "model")


def total_time(result: Result) -> np.ndarray | None:
    """From each sample's due time to its completion, µs; None where time was virtual and nothing was timed."""
    stages = [np.asarray(result[stage], dtype=float) for stage in STAGES if stage in result]
    return np.sum(stages, axis=0) if "lateness" in result else None


def late_samples(result: Result) -> np.ndarray | None:
    """Which samples were not complete one period after they were due; the first of a run is exempt."""
    total = total_time(result)
    if total is None:
        return None
    late = total > result.sample_period * 1e6
    return late & (result["time"] > result.sample_period / 2)
