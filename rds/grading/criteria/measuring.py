"""What the criteria share: samples that count, errors of the axis itself, steps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rds.core.errors import RdsError
from rds.core.quantities import Quantity
from rds.grading.cases.case import CaseRun
from rds.results.metrics import error_metrics, settled, tracking_error

Options = Mapping[str, Any]

WINDOW = {
    "from": Quantity("the first sample that counts", "s", low=0.0),
    "until": Quantity("the end of what counts", "s", above=0.0),
}
"""Which samples count. Without them all do but the first period of a periodic reference, as in every result."""


class NotMeasured(RdsError):
    """There is no value, for the reason in the message: no points."""


class NotKnown(NotMeasured):
    """There may be a value, but it could not be measured: for a review, and no zero.

    `at_best` is a value that what was seen comes near to: until the review it is not paid as if it were better.
    """

    def __init__(self, why: str, at_best: float | None = None):
        super().__init__(why)
        self.at_best = at_best


def over_axes(run: CaseRun, of: Callable[[str], float], worst: Callable[..., float] = max) -> float:
    """The worst of the axes."""
    return float(worst(of(axis) for axis in run.result.axes))


def used(run: CaseRun, axis: str, options: Options) -> slice | np.ndarray:
    """The samples that count; NotMeasured where there are none."""
    if "from" not in options and "until" not in options:
        return settled(run.result, axis)
    time, half = run.result["time"], run.result.sample_period / 2
    chosen: np.ndarray = (time >= options.get("from", 0.0) - half) & (time < options.get("until", np.inf) - half)
    if not chosen.any():
        raise NotMeasured("no sample of the run lies between `from` and `until`")
    return chosen


def actual(run: CaseRun, axis: str) -> np.ndarray:
    """Where the axis was by its encoder, without the noise of the case."""
    name = f"{axis}_actual"
    return run.result[name] if name in run.result else run.result[f"{axis}_measured"]


def error_of(run: CaseRun, axis: str) -> np.ndarray:
    """Reference - position at every sample, as every result has it; of the axis itself where the case has noise."""
    if f"{axis}_actual" in run.result:
        return np.asarray(run.result[f"{axis}_reference"] - actual(run, axis))
    error = tracking_error(run.result, axis)
    if error is None:
        raise NotMeasured(f"axis {axis} has no reference")
    return error


def error_metric(run: CaseRun, name: str, options: Options) -> float:
    """One of the metrics of a tracking error, the worst of the axes."""

    def of(axis: str) -> float:
        value = error_metrics(error_of(run, axis)[used(run, axis, options)])[name]
        if value is None:
            raise NotMeasured("there is no finite error to measure")
        return value

    return over_axes(run, of)


@dataclass(frozen=True)
class Step:
    """A response to a step: times from the step on (s), and the share of it that is done."""

    time: np.ndarray
    share: np.ndarray


STEP = {
    "from": Quantity("when the reference steps", "s", low=0.0),
    "until": Quantity("the end of the response", "s", above=0.0),
}


def step_of(run: CaseRun, axis: str, options: Options) -> Step:
    """The response from `from` (default 0) to `until` (default: the end) to the step that the reference makes there.

    It starts where the axis is and goes where the reference is at the end; NotMeasured if that is no step.
    """
    result, half = run.result, run.result.sample_period / 2
    time = result["time"]
    begin = options.get("from", 0.0)
    chosen = np.flatnonzero((time >= begin - half) & (time < options.get("until", np.inf) - half))
    if len(chosen) < 2:
        raise NotMeasured("the response has no samples")
    reference = result[f"{axis}_reference"][chosen]
    position = actual(run, axis)[chosen]
    final, size = float(reference[-1]), float(reference[-1] - position[0])
    if np.ptp(reference[1:]) > 1e-9 * max(1.0, abs(final)):
        raise NotMeasured(f"the reference of axis {axis} is no step: it changes again during the response")
    if size == 0.0:
        raise NotMeasured(f"axis {axis} has no step to make: it is where the reference is")
    return Step(time[chosen] - begin, (position - position[0]) / size)


def crossing(step: Step, level: float) -> float:
    """When the response first reaches this share of the step (above 0), s, on the line between two samples."""
    reached = np.flatnonzero(step.share >= level)
    if not len(reached):
        raise NotMeasured(f"the response never reaches {100 * level:g} % of the step")
    k = int(reached[0])  # not 0: there nothing is done yet
    a, b = step.share[k - 1], step.share[k]
    return float(step.time[k - 1] + (level - a) / (b - a) * (step.time[k] - step.time[k - 1]))


def over_loops(run: CaseRun, of: Callable[[Any], float], worst: Callable[[Iterable[float]], float]) -> float:
    """The worst of the linearized loops of all axes; NotMeasured or NotKnown with the reason where one has none."""
    from rds.grading.criteria.linear import NoLoop

    loops = run.linear or (NoLoop("the loop was not linearized", True),)
    missing = [loop for loop in loops if isinstance(loop, NoLoop)]
    if known := next((loop for loop in missing if loop.is_known), None):
        raise NotMeasured(known.why)
    nearest = [loop.nearest if isinstance(loop, NoLoop) else loop for loop in loops]
    value = float(worst(of(loop) for loop in nearest if loop is not None)) if any(nearest) else None
    if missing:
        raise NotKnown(missing[0].why, value)
    assert value is not None  # every case has an axis
    return value
