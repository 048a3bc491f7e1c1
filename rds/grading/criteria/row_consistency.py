"""Whether the rows' velocities are those of their positions: the mean of two rows' velocities moves the axes on."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options
from rds.grading.criteria.rows import velocities

MEANING = "the largest difference of a row's velocity from that of its positions"
UNIT = "mm/s"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In mm/s, without the first and the last step, at whose ends a method may jump."""
    if run.rows is None or len(run.rows) < 3:
        raise NotMeasured("the interpolation has too few rows")
    said = 0.5 * (run.rows[1:, 1] + run.rows[:-1, 1])
    return float(np.abs(said - velocities(run)[1:])[:-1].max())
