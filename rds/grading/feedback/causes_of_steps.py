"""Where a step response loses points: it swings, it creeps, it stays beside its end, or it is slow."""

from __future__ import annotations

import numpy as np

from rds.core.colours import BLUE
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.criterion import Criterion
from rds.grading.criteria.measuring import NotMeasured, Step, step_of
from rds.grading.feedback.advice import Cause
from rds.grading.feedback.causes_of_errors import SATURATED, saturation, voltage_panel, wrong_sign
from rds.grading.feedback.chart import Curve, Panel
from rds.grading.grade import CriterionScore

_BAND = 0.02  # of the step, where the criterion says no other
_LAST = 0.1  # of the response: where it has come to rest, if it has


def cause(run: CaseRun, criterion: Criterion, score: CriterionScore) -> Cause:
    """What the response of the worst axis does, and what answers it."""
    found: list[tuple[str, Step]] = []
    for axis in run.result.axes:
        try:
            found.append((axis, step_of(run, axis, criterion.options)))
        except NotMeasured:
            continue
    if not found:
        return Cause(score.sentence)
    axis, step = max(found, key=lambda pair: float(np.mean((pair[1].share - 1.0) ** 2)))
    within = float(criterion.options.get("within", 100 * _BAND)) / 100.0
    error = step.share - 1.0
    band = [(1.0 + within, f"±{100 * within:g} %"), (1.0 - within, "")]
    panels = [
        Panel([Curve("error", step.time, -100.0 * error, BLUE)], "error [% of the step]", "time from the step [s]"),
        Panel([Curve("response", step.time, step.share, BLUE)], "share of the step", "time from the step [s]", band),
    ]
    if away := wrong_sign(run, axis):
        return Cause(away, (*panels, voltage_panel(run, axis)))
    return _said(run, axis, step, error, within, panels)


def _said(run: CaseRun, axis: str, step: Step, error: np.ndarray, within: float, panels: list[Panel]) -> Cause:
    over, crossings = float(step.share.max() - 1.0), _crossings(error, within)
    end = float(np.mean(error[-max(2, int(_LAST * len(error))) :]))
    saturated = saturation(run, axis)
    if crossings >= 3:
        said = (
            f"The response of axis {axis} swings: it leaves the band of ±{100 * within:g} % on one side and then the "
            f"other {crossings} times. Give it more damping (more derivative action), or less gain."
        )
    elif over > within:
        said = (
            f"The response of axis {axis} goes {100 * over:.3g} % of the step too far. Give it more damping (more "
            "derivative action) or less gain; with an integral part, less of that, and stop it at the converter's "
            "limit."
        )
    elif abs(end) > within:
        creeps = abs(error[-1]) < 0.9 * abs(error[len(error) // 2])
        said = f"The response of axis {axis} is still {100 * abs(end):.3g} % of the step from its end, and " + (
            "gets there slowly: raise the gain." if creeps else "stays there: add integral action."
        )
    elif saturated > SATURATED:
        said = (
            f"The converter is at its limit for {100 * saturated:.0f} % of the response of axis {axis}: what is "
            "left is "
            "how soon the controller brakes. Less derivative action lets it run on longer."
        )
        panels.append(voltage_panel(run, axis))
    else:
        said = (
            f"The response of axis {axis} neither swings nor goes too far: it is only slow. Raise the gain, as far "
            "as the "
            "loop keeps its margins."
        )
    return Cause(said, tuple(panels))


def _crossings(error: np.ndarray, within: float) -> int:
    """How often it goes from one side of the band to the other."""
    outside = error[np.abs(error) > within]
    return int(np.count_nonzero(np.diff(np.sign(outside)) != 0.0))
