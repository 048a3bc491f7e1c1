"""How long an interpolation takes, so that none is good by being slow."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import Options
from rds.grading.criteria.rows import positions

MEANING = "the time that the move takes"
UNIT = "s"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In s, from the start of the segment to the last row."""
    return float((len(positions(run)) - 1) * run.result.sample_period)
