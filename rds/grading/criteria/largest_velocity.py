"""The largest velocity of an axis, by differences of an interpolation's positions."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import Options
from rds.grading.criteria.rows import velocities

MEANING = "the largest velocity of an axis"
UNIT = "mm/s"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In mm/s."""
    return float(np.abs(velocities(run)).max())
