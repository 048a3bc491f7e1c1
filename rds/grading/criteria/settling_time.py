"""Settling time of a step response: after it, the axis stays within a band about the final reference."""

from __future__ import annotations

import numpy as np

from rds.core.quantities import Quantity
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import STEP, NotMeasured, Options, over_axes, step_of

MEANING = "the settling time"
UNIT = "s"
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = {"within": Quantity("share of the step, to either side of the final reference", "%", above=0.0), **STEP}
DEFAULTS = {"within": 2.0}


def measure(run: CaseRun, options: Options) -> float:
    """In s, from the step to the first sample after which the axis does not leave the band."""

    def of(axis: str) -> float:
        step = step_of(run, axis, options)
        outside = np.flatnonzero(np.abs(step.share - 1.0) > options["within"] / 100.0)
        if not len(outside):
            return 0.0
        if outside[-1] == len(step.share) - 1:
            raise NotMeasured(f"axis {axis} has not settled by the end of the response")
        return float(step.time[outside[-1] + 1])

    return over_axes(run, of)
