"""Noise rejection: how much the axis itself moves under noise on its encoder, as a standard deviation of its error."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import WINDOW, Options, error_metric

MEANING = "the standard deviation of the error under noise"
UNIT = None
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = WINDOW
CASE_HAS = ("noise",)


def measure(run: CaseRun, options: Options) -> float:
    """In the axis's unit, of the axis as its encoder would read it without the noise."""
    return error_metric(run, "std_error", options)
