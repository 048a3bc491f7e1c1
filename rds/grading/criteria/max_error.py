"""The largest tracking error, max |e|, as in every result: e = reference - measured, the worst axis."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import WINDOW, Options, error_metric

MEANING = "the largest tracking error"
UNIT = None
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = WINDOW


def measure(run: CaseRun, options: Options) -> float:
    """In the axis's unit."""
    return error_metric(run, "max_abs_error", options)
