"""The chord error: the largest distance from the segment of the middle between two samples."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import Options
from rds.grading.criteria.rows import positions
from rds.interpolators.deviation import distances

MEANING = "the largest chord error"
UNIT = "mm"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In mm."""
    places = positions(run)
    return float(distances(run.fact("segment"), 0.5 * (places[1:] + places[:-1])).max())
