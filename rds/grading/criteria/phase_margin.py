"""The phase margin of the linearized loop, measured from outside; see `rds.grading.criteria.linear`."""

from __future__ import annotations

from rds.grading.cases.case import LINEAR, CaseRun
from rds.grading.criteria.measuring import Options, over_loops

MEANING = "the phase margin"
UNIT = "°"
MORE_IS_WORSE = False
FOR = ("controller",)
NEEDS = (LINEAR,)


def measure(run: CaseRun, options: Options) -> float:
    """In degrees; a loop whose gain is never 1 has 180."""
    return min(over_loops(run, lambda loop: float(loop.margins[1]), min), 180.0)
