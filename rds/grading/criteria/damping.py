"""The least damping ratio of the linearized closed loop's poles; see `rds.grading.criteria.linear`."""

from __future__ import annotations

from rds.grading.cases.case import LINEAR, CaseRun
from rds.grading.criteria.measuring import Options, over_loops

MEANING = "the least damping ratio of the closed loop's poles"
UNIT = "1"
MORE_IS_WORSE = False
FOR = ("controller",)
NEEDS = (LINEAR,)


def measure(run: CaseRun, options: Options) -> float:
    """Without a unit: 1 where nothing oscillates."""
    return over_loops(run, lambda loop: float(loop.least_damping), min)
