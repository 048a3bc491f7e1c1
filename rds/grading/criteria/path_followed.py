"""The share of the samples that are within a tolerance of the path."""

from __future__ import annotations

import numpy as np

from rds.core.quantities import Quantity
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.contour import contour
from rds.grading.criteria.measuring import WINDOW, NotMeasured, Options

MEANING = "the part of the path within the tolerance"
UNIT = "%"
MORE_IS_WORSE = False
FOR = ("controller",)
OPTIONS = {"tolerance": Quantity("distance from the path", "mm", above=0.0), **WINDOW}
NEEDED = ("tolerance",)


def measure(run: CaseRun, options: Options) -> float:
    """In per cent. A program that did not come to its end has not been followed."""
    program = run.result.meta.get("program")
    if program is not None and not program["completed"]:
        raise NotMeasured("the part program did not come to its end")
    return 100.0 * float(np.mean(contour(run, options) <= options["tolerance"]))
