"""The least distance of the linearized loop's frequency response from -1; see `rds.grading.criteria.linear`."""

from __future__ import annotations

from rds.grading.cases.case import LINEAR, CaseRun
from rds.grading.criteria.measuring import Options, over_loops

MEANING = "the least distance of the loop from -1"
UNIT = "1"
MORE_IS_WORSE = False
FOR = ("controller",)
NEEDS = (LINEAR,)


def measure(run: CaseRun, options: Options) -> float:
    """Without a unit: 1/modulus is the largest gain of the sensitivity."""
    return over_loops(run, lambda loop: float(loop.margins[2]), min)
