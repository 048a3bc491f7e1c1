"""Disturbance rejection: the largest tracking error while the case's disturbance acts."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options, error_of, over_axes

MEANING = "the largest error under the disturbance"
UNIT = None
MORE_IS_WORSE = True
FOR = ("controller",)
CASE_HAS = ("disturbance",)


def measure(run: CaseRun, options: Options) -> float:
    """In the axis's unit, from the disturbance's start to the end of the run."""
    chosen = run.result["time"] >= run.fact("disturbed_from") - run.result.sample_period / 2
    if not chosen.any():
        raise NotMeasured("the run ended before the disturbance")
    return over_axes(run, lambda axis: float(np.abs(error_of(run, axis)[chosen]).max()))
