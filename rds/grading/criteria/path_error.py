"""The largest distance of an interpolation's samples from the segment."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import Options
from rds.grading.criteria.rows import positions
from rds.interpolators.deviation import distances

MEANING = "the largest distance of a sample from the path"
UNIT = "mm"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In mm."""
    return float(distances(run.fact("segment"), positions(run)).max())
