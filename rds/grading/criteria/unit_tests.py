"""Unit tests: functions of the submission with plain arguments, and what they must return."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options

MEANING = "the share of unit tests passed"
UNIT = "%"
MORE_IS_WORSE = False
FOR = ("controller", "model", "interpolator", "functions")


def measure(run: CaseRun, options: Options) -> float:
    """Its tests are no run of a case; see `rds.grading.assignment.unit_tests`."""
    raise NotMeasured("unit tests are called, not run")
