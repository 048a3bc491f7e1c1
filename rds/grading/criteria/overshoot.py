"""Overshoot of a step response: how far beyond the final reference, in per cent of the step."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import STEP, Options, over_axes, step_of

MEANING = "the overshoot"
UNIT = "%"
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = STEP


def measure(run: CaseRun, options: Options) -> float:
    """In per cent of the step; 0 for a response that stays below."""
    return over_axes(run, lambda axis: max(0.0, 100.0 * float(step_of(run, axis, options).share.max() - 1.0)))
