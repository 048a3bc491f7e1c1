"""The contour error: the largest distance of the axes' position from the path, whenever they are there."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.contour import contour
from rds.grading.criteria.measuring import WINDOW, Options

MEANING = "the largest contour error"
UNIT = None
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = WINDOW


def measure(run: CaseRun, options: Options) -> float:
    """In mm."""
    return float(contour(run, options).max())
