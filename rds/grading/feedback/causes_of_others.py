"""Where voltages, models and rows lose points: where in the run, how large, and what answers it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from rds.core.colours import BLUE, GREY
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.criterion import Criterion
from rds.grading.feedback.advice import Cause
from rds.grading.feedback.causes_of_errors import saturation, voltage_panel
from rds.grading.feedback.chart import Curve, Panel
from rds.grading.grade import CriterionScore
from rds.results.units import heading

_SHIFTS = 60  # samples to either side, in which a model's delay is looked for


def cause(run: CaseRun, criterion: Criterion, score: CriterionScore) -> Cause:
    """By what is measured."""
    return _BY_KIND.get(criterion.kind, _of_rows)(run, score)


def _of_voltage(run: CaseRun, score: CriterionScore) -> Cause:
    """How much of the voltage's change is from sample to sample, and how much is motion."""
    axis = max(run.result.axes, key=lambda each: float(np.mean(_voltage(run, each) ** 2)))
    voltage = _voltage(run, axis)
    rough, whole = float(np.sqrt(np.mean(np.diff(voltage) ** 2))), float(np.sqrt(np.mean(voltage**2)))
    saturated = saturation(run, axis)
    said = (
        f"The voltage of axis {axis} is {whole:.3g} V (RMS), and changes by {rough:.3g} V (RMS) from sample to sample"
        + (f"; it asks for the limit in {100 * saturated:.0f} % of the samples" if saturated else "")
        + ". "
        + (
            "Most of that is noise that the law makes larger: filter the derivative, or take less of it."
            if rough > 0.1 * whole
            else "Little of that is noise: take less gain, so that it asks for less at once."
        )
    )
    return Cause(said, (voltage_panel(run, axis),))


def _of_noise(run: CaseRun, score: CriterionScore) -> Cause:
    """What the law makes of the error's changes from sample to sample, most of which are noise."""
    axis = max(run.result.axes, key=lambda each: float(np.mean(np.diff(_voltage(run, each)) ** 2)))
    error = run.result[f"{axis}_reference"] - run.result[f"{axis}_measured"]
    changes, made = (float(np.sqrt(np.mean(np.diff(each) ** 2))) for each in (error, _voltage(run, axis)))
    unit = run.result.units.get(f"{axis}_measured", "mm")
    gain = f", {made / changes:.3g} V/{unit}" if changes else ""
    said = (
        f"The error of axis {axis} changes by {changes:.3g} {unit} (RMS) from sample to sample, and the voltage by "
        f"{made:.3g} V{gain}: estimate the velocity by an observer or filter it more, and take less derivative or gain."
    )
    return Cause(said, (voltage_panel(run, axis),))


def _voltage(run: CaseRun, axis: str) -> np.ndarray:
    name = f"{axis}_command" if f"{axis}_command" in run.result else f"{axis}_voltage"
    return np.asarray(np.nan_to_num(run.result[name]))


def _of_work(run: CaseRun, score: CriterionScore) -> Cause:
    del run
    return Cause(
        f"{score.sentence} Compute once, before the first sample or in the first one, what does not change: gains, "
        "matrices, tables."
    )


def _of_model(run: CaseRun, score: CriterionScore) -> Cause:
    """Whether the model moves too far, too late, or elsewhere."""
    axis = run.result.axes[0]
    measured, modelled = run.result[f"{axis}_measured"], run.result[f"{axis}_modelled"]
    unit = run.result.units.get(f"{axis}_measured", "mm")
    panels = (
        Panel([Curve("measured − modelled", run.result["time"], measured - modelled, BLUE)], heading("error", unit)),
        Panel(
            [
                Curve("measured", run.result["time"], measured, GREY, 3.0, expected=True),
                Curve("your model", run.result["time"], modelled, BLUE),
            ],
            heading(f"{axis} position", unit),
        ),
    )
    a, b = measured - measured[0], modelled - modelled[0]
    size = float(np.dot(b, b))
    if not size > 0.0 or not np.isfinite(size):
        return Cause("The model does not move, or is not finite: look at its equation first.", panels)
    gain = float(np.dot(a, b)) / size
    steps = range(-_SHIFTS, _SHIFTS + 1)
    shift = min(steps, key=lambda k: float(np.mean((a[_SHIFTS:-_SHIFTS] - np.roll(b, k)[_SHIFTS:-_SHIFTS]) ** 2)))
    late = 1e3 * shift * run.result.sample_period
    whole = float(np.mean((a - b) ** 2))
    by_gain = float(np.mean((a - gain * b) ** 2))
    by_time = float(np.mean((a - np.roll(b, shift))[_SHIFTS:-_SHIFTS] ** 2))
    if by_gain <= by_time and by_gain < 0.8 * whole:
        way = "too little" if gain > 1.0 else "too far"
        said = f"The model moves {way}: {gain:.3g} times its motion fits best. Change its gain by that factor."
    elif shift and by_time < 0.8 * whole:
        way = (
            "early: give it a larger time constant, or a delay" if shift > 0 else "late: its time constant is too large"
        )
        said = f"The model is {abs(late):.3g} ms too {way}."
    else:
        said = "Neither another gain nor another delay mends the model much: it lacks a part, such as friction or play."
    return Cause(said, panels)


def _of_rows(run: CaseRun, score: CriterionScore) -> Cause:
    """Where along the rows the speed and its change are largest."""
    if run.rows is None or len(run.rows) < 3:
        return Cause(score.sentence)
    positions, T = run.rows[:, 0, :], run.result.sample_period
    velocity = np.linalg.norm(np.diff(positions, axis=0), axis=1) / T
    change = np.linalg.norm(np.diff(positions, 2, axis=0), axis=1) / T**2
    time = np.arange(len(velocity)) * T
    fastest, sharpest = int(np.argmax(velocity)), int(np.argmax(change))
    said = (
        f"{score.sentence} By the differences of your positions, the speed is largest at {time[fastest]:.4g} s "
        f"({velocity[fastest]:.4g} mm/s), and it changes most at {time[sharpest]:.4g} s ({change[sharpest]:.4g} mm/s²)."
    )
    return Cause(
        said,
        (
            Panel([Curve("speed", time, velocity, BLUE)], heading("path speed", "mm/s")),
            Panel([Curve("change of the velocity", time[1:], change, BLUE)], heading("path acceleration", "mm/s²")),
        ),
    )


_BY_KIND: Mapping[str, Callable[[CaseRun, CriterionScore], Cause]] = {
    **dict.fromkeys(("effort", "saturation-time"), _of_voltage),
    "noise-voltage": _of_noise,
    "work": _of_work,
    "model-fit": _of_model,
}
