"""Disturbance rejection: how long after the disturbance begins the error stays within a tolerance again."""

from __future__ import annotations

import numpy as np

from rds.core.quantities import Quantity
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options, error_of, over_axes

MEANING = "the time to recover from the disturbance"
UNIT = "s"
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = {"within": Quantity("about the reference, in the axis's unit", above=0.0)}
NEEDED = ("within",)
CASE_HAS = ("disturbance",)


def measure(run: CaseRun, options: Options) -> float:
    """In s, from the disturbance's start; 0 where the error never leaves the tolerance."""
    time, begin = run.result["time"], run.fact("disturbed_from")
    after = np.flatnonzero(time >= begin - run.result.sample_period / 2)

    def of(axis: str) -> float:
        outside = after[np.abs(error_of(run, axis)[after]) > options["within"]]
        if not len(after) or (len(outside) and outside[-1] == len(time) - 1):
            raise NotMeasured(f"axis {axis} has not recovered from the disturbance by the end of the run")
        return float(time[outside[-1] + 1] - begin) if len(outside) else 0.0

    return over_axes(run, of)
