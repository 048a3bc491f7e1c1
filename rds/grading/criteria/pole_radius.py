"""The closed loop's slowest pole: the largest |z| of the linearized loop; see `rds.grading.criteria.linear`."""

from __future__ import annotations

from rds.grading.cases.case import LINEAR, CaseRun
from rds.grading.criteria.measuring import Options, over_loops

MEANING = "the largest pole |z| of the closed loop"
UNIT = "1"
MORE_IS_WORSE = True
FOR = ("controller",)
NEEDS = (LINEAR,)


def measure(run: CaseRun, options: Options) -> float:
    """Without a unit: a mode falls to |z| of itself in each sample."""
    return over_loops(run, lambda loop: float(abs(loop.poles[0])), max)
