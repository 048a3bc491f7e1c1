"""The gain margin of the linearized loop, measured from outside; see `rds.grading.criteria.linear`."""

from __future__ import annotations

from rds.grading.cases.case import LINEAR, CaseRun
from rds.grading.criteria.measuring import Options, over_loops

MEANING = "the gain margin"
UNIT = "dB"
MORE_IS_WORSE = False
FOR = ("controller",)
NEEDS = (LINEAR,)


def measure(run: CaseRun, options: Options) -> float:
    """In dB: the least change of the gain, up or down, that makes the loop unstable; 1000 where none does."""
    return min(over_loops(run, lambda loop: float(loop.margins[0]), min), 1000.0)
