"""The fit of a model's free run to hidden data, 100 (1 - ‖y - ŷ‖ / ‖y - mean(y)‖)."""

from __future__ import annotations

from rds.grading.cases.case import CaseRun
from rds.grading.criteria.measuring import WINDOW, NotMeasured, Options, over_axes, used
from rds.results.metrics import fit_percent

MEANING = "the fit of the model's free run"
UNIT = "%"
MORE_IS_WORSE = False
FOR = ("model",)
OPTIONS = WINDOW


def measure(run: CaseRun, options: Options) -> float:
    """In per cent; negative where the mean of the data would be nearer."""

    def of(axis: str) -> float:
        chosen = used(run, axis, options)
        fit = fit_percent(run.result[f"{axis}_measured"][chosen], run.result[f"{axis}_modelled"][chosen])
        if fit is None:
            raise NotMeasured("the fit is no number: the model's output is beyond measure, or the data never move")
        return fit

    return over_axes(run, of, min)
