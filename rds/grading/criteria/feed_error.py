"""By how much the speed along the path exceeds the feed rate, in per cent."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options
from rds.grading.criteria.rows import velocities

MEANING = "the largest excess of the speed over the feed rate"
UNIT = "%"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In per cent of the feed rate; 0 where it is never exceeded. NotMeasured where nothing moves."""
    speed = float(np.linalg.norm(velocities(run), axis=1).max())
    if speed == 0.0:
        raise NotMeasured("nothing moves")
    return max(0.0, 100.0 * (speed / float(run.fact("segment").feed_rate) - 1.0))
