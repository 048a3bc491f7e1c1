"""Rise time of a step response: from 10 % to 90 % of the step."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import STEP, Options, crossing, over_axes, step_of

MEANING = "the rise time, 10 % to 90 % of the step,"
UNIT = "s"
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = STEP


def measure(run: CaseRun, options: Options) -> float:
    """In s."""

    def of(axis: str) -> float:
        step = step_of(run, axis, options)
        return crossing(step, 0.9) - crossing(step, 0.1)

    return over_axes(run, of)
