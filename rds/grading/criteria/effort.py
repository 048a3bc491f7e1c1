"""Control effort: the RMS of the voltage that acts on the axis."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import WINDOW, Options, over_axes, used

MEANING = "the control effort, RMS of the voltage,"
UNIT = "V"
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = WINDOW


def measure(run: CaseRun, options: Options) -> float:
    """In V."""

    def of(axis: str) -> float:
        voltage = run.result[f"{axis}_voltage"][used(run, axis, options)]
        return float(np.sqrt(np.mean(voltage**2)))

    return over_axes(run, of)
