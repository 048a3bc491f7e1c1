"""How far the last row of an interpolation is from the segment's end."""

from __future__ import annotations

import numpy as np

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import Options
from rds.grading.criteria.rows import positions

MEANING = "the distance of the last row from the end point"
UNIT = "mm"
MORE_IS_WORSE = True
FOR = ("interpolator",)


def measure(run: CaseRun, options: Options) -> float:
    """In mm."""
    return float(np.linalg.norm(positions(run)[-1] - np.array(run.fact("segment").end)))
