"""Pictures of a case: the student's run beside the reference solution's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rds.core.colours import BLUE, GREEN, GREY, VERMILLION
from rds.grading.cases.case import CaseRun
from rds.grading.feedback.chart import VOLTAGES, Chart, Curve, Panel, chart
from rds.grading.feedback.plain_text import one_line
from rds.results import Result
from rds.results.metrics import tracking_error
from rds.results.units import heading

YOURS, SOLUTION, REFERENCE, MEASURED = "your run", "reference solution", "reference", "measured"
_MOST_AXES = 3  # in one picture


@dataclass(frozen=True)
class CasePicture:
    """A picture with what it shows in words."""

    chart: Chart
    caption: str


def case_picture(runs: Sequence[CaseRun], solution: Sequence[CaseRun], title: str) -> CasePicture | None:
    """The picture of one case's runs: of several, the one that went worst. None if there is nothing to draw.

    `solution` are runs of the reference solution on the same case, empty where there is none.
    """
    drawable = [run for run in runs if len(run.result) > 1]
    if not drawable:
        return None
    run = max(drawable, key=_badness)
    beside = next((each for each in solution if each.number == run.number and len(each.result) > 1), None)
    panels = _panels(run, beside)
    if not panels:
        return None
    drawn = chart(panels)
    said = [title]
    if len(runs) > 1:
        said.append(f"run {run.number + 1} of {len(runs)}, the one with the largest error")
    if run.fault:
        said.append(one_line(run.fault, 300).rstrip("."))
    if drawn.is_cut:
        said.append("where your run goes far beyond the reference, it is cut off")
    return CasePicture(drawn, "; ".join(said) + ".")


def _badness(run: CaseRun) -> float:
    """What tells the worst of several runs: a fault, else its largest error."""
    if run.fault:
        return np.inf
    largest = 0.0
    for axis in run.result.axes:
        error = _error(run.result, axis)
        if error is not None:
            largest = max(largest, float(np.nan_to_num(np.abs(error), nan=np.inf).max(initial=0.0)))
    return largest


def _error(result: Result, axis: str) -> np.ndarray | None:
    if f"{axis}_modelled" in result:
        return np.asarray(result[f"{axis}_measured"] - result[f"{axis}_modelled"])
    if f"{axis}_actual" in result and f"{axis}_reference" in result:
        return np.asarray(result[f"{axis}_reference"] - result[f"{axis}_actual"])
    return tracking_error(result, axis)


def _panels(run: CaseRun, solution: CaseRun | None) -> list[Panel]:
    axes = run.result.axes[:_MOST_AXES]
    beside = None if solution is None else solution.result
    if run.rows is not None:
        return _rows_panels(run.result, beside, axes)
    if f"{axes[0]}_modelled" in run.result:
        return _model_panels(run.result, beside, axes[0])
    return _control_panels(run, beside, axes)


def _control_panels(run: CaseRun, beside: Result | None, axes: Sequence[str]) -> list[Panel]:
    result = run.result
    panels: list[Panel] = []
    for axis in axes:  # the error first: it is what the points are for
        own, other = _error(result, axis), None if beside is None else _error(beside, axis)
        if own is None:
            continue
        unit = result.units.get(f"{axis}_measured", "")
        most = _most_error(result, f"{axis}_reference")
        panels.append(Panel(_two(result, own, beside, other), heading(f"{axis} error", unit), most=most))
    if len(axes) > 1:
        panels.append(_path(result, beside, axes, "_measured", "_reference"))
    else:
        curves = _pair(result, beside, f"{axes[0]}_measured")
        panels.append(Panel([_reference(result, f"{axes[0]}_reference"), *curves], _label(result, axes[0], "measured")))
    limits = run.fact("limits")
    levels = [(float(each), "limit") for each in limits or () if np.isfinite(each)]
    for axis in axes:
        word = next((word for word in VOLTAGES if f"{axis}_{word}" in result), "")
        if word:
            curves = _pair(result, beside, f"{axis}_{word}")
            panels.append(Panel(curves, heading(f"{axis} {VOLTAGES[word]}", "V"), levels=levels))
    return panels


def _most_error(result: Result, name: str) -> float | None:
    """Larger errors than what there is to follow say no more than that it was not followed."""
    values = result[name][np.isfinite(result[name])]
    return 2.0 * float(np.abs(values).max(initial=0.0)) or None


def _model_panels(result: Result, beside: Result | None, axis: str) -> list[Panel]:
    data = Curve(MEASURED, result["time"], result[f"{axis}_measured"], GREY, 3.0, expected=True)
    own, other = _error(result, axis), None if beside is None else _error(beside, axis)
    assert own is not None  # both of its columns are there
    unit = result.units.get(f"{axis}_measured", "")
    voltage = Curve("", result["time"], result[f"{axis}_voltage"], VERMILLION, expected=True)
    return [
        Panel(
            _two(result, own, beside, other),
            heading("measured − modelled", unit),
            most=_most_error(result, f"{axis}_measured"),
        ),
        Panel([data, *_pair(result, beside, f"{axis}_modelled")], _label(result, axis, "measured")),
        Panel([voltage], heading("voltage", "V")),
    ]


def _rows_panels(result: Result, beside: Result | None, axes: Sequence[str]) -> list[Panel]:
    panels = [_path(result, beside, axes, "_reference", "")] if len(axes) > 1 else []
    for word, unit in (("velocity", "mm/s"), ("acceleration", "mm/s²")):
        own, other = _magnitude(result, axes, word), None if beside is None else _magnitude(beside, axes, word)
        panels.append(Panel(_two(result, own, beside, other), heading(f"path {word}", unit)))
    return panels


def _magnitude(result: Result, axes: Sequence[str], word: str) -> np.ndarray:
    with np.errstate(over="ignore", invalid="ignore"):
        size: np.ndarray = np.sqrt(sum(np.square(result[f"{axis}_reference_{word}"]) for axis in axes))
    return size


def _path(result: Result, beside: Result | None, axes: Sequence[str], word: str, reference: str) -> Panel:
    """The first two axes against each other."""
    first, second = axes[0], axes[1]
    curves = []
    if reference and f"{first}{reference}" in result:
        x, y = result[f"{first}{reference}"], result[f"{second}{reference}"]
        curves.append(Curve(REFERENCE, x, y, GREY, 3.0, expected=True))
    if beside is not None:
        x, y = beside[f"{first}{word}"], beside[f"{second}{word}"]
        curves.append(Curve(SOLUTION, x, y, GREEN, dashes="6 3", expected=True))
    curves.append(Curve(YOURS, result[f"{first}{word}"], result[f"{second}{word}"], BLUE))
    units = (result.units.get(f"{axis}{word}", "mm") for axis in (first, second))
    x_label, y_label = (heading(axis, unit) for axis, unit in zip((first, second), units, strict=True))
    return Panel(curves, y_label, x_label, is_path=True)


def _reference(result: Result, name: str) -> Curve:
    return Curve(REFERENCE, result["time"], result[name], GREY, 3.0, expected=True)


def _pair(result: Result, beside: Result | None, name: str) -> list[Curve]:
    other = None if beside is None or name not in beside else beside[name]
    return _two(result, result[name], beside, other)


def _two(result: Result, own: np.ndarray, beside: Result | None, other: np.ndarray | None) -> list[Curve]:
    """The student's curve, and the solution's over it where there is one: dashed, so that both show."""
    curves = [Curve(YOURS, result["time"], own, BLUE)]
    if beside is not None and other is not None:
        curves.append(Curve(SOLUTION, beside["time"], other, GREEN, dashes="6 3", expected=True))
    return curves


def _label(result: Result, axis: str, word: str) -> str:
    return heading(f"{axis} position", result.units.get(f"{axis}_{word}", ""))
