"""Time in saturation: for how long the controller asks for as much as the converter gives, or more."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import Options, over_axes

MEANING = "the time in saturation"
UNIT = "s"
MORE_IS_WORSE = True
FOR = ("controller",)


def measure(run: CaseRun, options: Options) -> float:
    """In s, over the whole run."""
    low, high = run.fact("limits")

    def of(axis: str) -> float:
        command = run.result[f"{axis}_command"]
        return run.result.sample_period * float(np.count_nonzero((command <= low) | (command >= high)))

    return over_axes(run, of)
