"""The steady-state error: the mean of reference - position at the end of the run, without its sign."""

from __future__ import annotations

from rds.core.quantities import Quantity
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import NotMeasured, Options, error_of, over_axes

MEANING = "the steady-state error"
UNIT = None
MORE_IS_WORSE = True
FOR = ("controller",)
OPTIONS = {
    "last": Quantity("time over which the mean is taken", "s", above=0.0),
    "until": Quantity("where it ends; default: with the run", "s", above=0.0),
}
DEFAULTS = {"last": 0.1}


def measure(run: CaseRun, options: Options) -> float:
    """In the axis's unit."""
    time, T = run.result["time"], run.result.sample_period
    end = options.get("until", float(time[-1]) + T)
    chosen = (time >= end - options["last"] - T / 2) & (time < end - T / 2)
    if not chosen.any():
        raise NotMeasured("the run ended before its steady state")
    return over_axes(run, lambda axis: abs(float(error_of(run, axis)[chosen].mean())))
