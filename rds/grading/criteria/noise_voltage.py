"""Noise rejection: how much noise comes through to the voltage, as the RMS of its change from sample to sample."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import WINDOW, NotMeasured, Options, over_axes, used

MEANING = "the RMS change of the voltage from sample to sample"
UNIT = "V"
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = WINDOW


def measure(run: CaseRun, options: Options) -> float:
    """In V."""

    def of(axis: str) -> float:
        changes = np.diff(run.result[f"{axis}_voltage"][used(run, axis, options)])
        if not len(changes):
            raise NotMeasured("the run has no two samples to compare")
        return float(np.sqrt(np.mean(changes**2)))

    return over_axes(run, of)
