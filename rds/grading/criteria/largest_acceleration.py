"""The largest acceleration of an axis, by second differences of an interpolation's positions, from rest to rest."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import Options
from rds.grading.criteria.rows import velocities

MEANING = "the largest acceleration of an axis"
UNIT = "mm/s²"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In mm/s². It is at rest before the first sample and after the last."""
    sent = np.pad(velocities(run), ((1, 1), (0, 0)))
    return float(np.abs(np.diff(sent, axis=0)).max()) / run.result.sample_period
