"""Where a tracking error comes from: what part follows the velocity, the acceleration or the direction, or stays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rds.core.colours import BLUE, VERMILLION
from rds.grading.cases.case import CaseRun
from rds.grading.criteria.criterion import Criterion
from rds.grading.criteria.measuring import NotMeasured, actual, error_of, used
from rds.grading.feedback.advice import Cause
from rds.grading.feedback.chart import VOLTAGES, Curve, Panel
from rds.grading.grade import CriterionScore
from rds.results import Result
from rds.results.units import heading

LEAST = 0.5  # of the error's square: what a cause must explain to be named
SHORT = 0.5  # of the motion that is asked for: an axis that makes less than that does not follow
SATURATED = 0.1  # of the time at the converter's limit: then nothing else is said
_AWAY, _OPPOSITE = 2.0, 0.9  # times the reference's largest value; of the samples: an axis that is driven off
_SWINGS = 4.0  # times the reference's own frequency: what is faster is the loop's


@dataclass(frozen=True)
class Part:
    """A part of the error that is in proportion to `shape`: how much of its square that is, and the part itself."""

    name: str
    factor: float
    share: float
    values: np.ndarray


def cause(run: CaseRun, criterion: Criterion, score: CriterionScore) -> Cause:
    """The largest part of the error of the worst axis, and what answers it."""
    del score
    axis = max(run.result.axes, key=lambda each: float(np.sqrt(np.mean(error_of(run, each) ** 2))))
    error = error_of(run, axis)
    chosen = _chosen(run, axis, criterion)
    unit = run.result.units.get(f"{axis}_measured", "mm")
    if short := _falls_short(run, axis):
        return Cause(short, (_panel(run, axis, error, None, unit), voltage_panel(run, axis)))
    if away := wrong_sign(run, axis):
        return Cause(away, (_panel(run, axis, error, None, unit), voltage_panel(run, axis)))
    saturated = saturation(run, axis, chosen)
    if saturated > SATURATED:
        said = (
            f"The controller asks for the converter's limit in {100 * saturated:.0f} % of the samples, and there no "
            "gain "
            "helps. Ask for less: less gain, or a filtered derivative; with an integral part, stop it at the limit."
        )
        return Cause(said, (_panel(run, axis, error, None, unit), voltage_panel(run, axis)))
    part = largest_part(run, axis, error, chosen)
    if part is None:
        swing = _swing(run.result, axis, error, chosen)
        said = (
            f"Most of the error of axis {axis} swings at {swing:.3g} Hz, which the reference does not: that is the "
            "loop's "
            "own swinging. Give it more damping (more derivative action), or less gain."
            if swing
            else f"The error of axis {axis} follows neither velocity nor acceleration, and it does not stay: raise the "
            "gain, as far as the loop keeps its margins."
        )
        return Cause(said, (_panel(run, axis, error, None, unit),))
    return Cause(_said(part, axis, unit), (_panel(run, axis, error, part, unit),))


def wrong_sign(run: CaseRun, axis: str) -> str:
    """That the voltage drives the axis away from its reference; empty where it does not.

    It has the sign opposite to the error's in nearly all samples, and the error outgrows all that is asked for.
    """
    error, name = error_of(run, axis), f"{axis}_command"
    voltage = run.result[name if name in run.result else f"{axis}_voltage"]
    if not (np.isfinite(error).all() and abs(error[-1]) > _AWAY * np.abs(run.result[f"{axis}_reference"]).max()):
        return ""
    opposite = float(np.mean(voltage * error < 0.0))
    if opposite < _OPPOSITE:
        return ""
    return (
        f"Axis {axis} runs away: in {100 * opposite:.0f} % of the samples the voltage has the sign opposite to the "
        "error's, and drives the axis further off. Turn the sign: a voltage above 0 moves the axis forward, so the law "
        "needs the reference minus the measurement, `r.position - y`."
    )


def _falls_short(run: CaseRun, axis: str) -> str:
    """That the axis makes much less of the motion than is asked for; empty where it does not."""
    asked = run.result[f"{axis}_reference"] - run.result[f"{axis}_reference"].mean()
    done = actual(run, axis)
    size = float(np.dot(asked, asked))
    if not size > 0.0 or not np.isfinite(done).all():
        return ""
    share = float(np.dot(done - done.mean(), asked)) / size
    if abs(share) >= SHORT:
        return ""
    return (
        f"Axis {axis} makes {100 * share:.3g} % of the motion that is asked for: the law hardly acts. Look whether its "
        "voltage depends on the error at all, and with which sign; then raise the gain."
    )


def largest_part(run: CaseRun, axis: str, error: np.ndarray, chosen: np.ndarray | slice) -> Part | None:
    """The one shape that explains the most of the error in these samples, if it explains half of its square."""
    whole = float(np.mean(error[chosen] ** 2))
    if not whole > 0.0 or not np.isfinite(whole):
        return None
    velocity, acceleration = (run.result[f"{axis}_reference_{word}"] for word in ("velocity", "acceleration"))
    shapes = {
        "velocity": velocity,
        "acceleration": acceleration,
        "direction": np.sign(velocity),
        "offset": np.ones_like(error),
    }
    found: list[Part] = []
    for name, shape in shapes.items():
        size = float(np.mean(shape[chosen] ** 2))
        if size > 0.0:
            factor = float(np.mean(error[chosen] * shape[chosen])) / size
            found.append(Part(name, factor, factor**2 * size / whole, factor * shape))
    # what moves one way only has its velocity's sign and an offset alike: the first that explains as much is named
    best = max(found, key=lambda part: round(part.share, 3), default=None)
    return best if best is not None and best.share >= LEAST else None


def _said(part: Part, axis: str, unit: str) -> str:
    share = f"{100 * part.share:.0f} %"
    if part.name == "velocity" and part.factor > 0.0:
        return (
            f"{share} of the squared error of axis {axis} is in proportion to the reference's velocity: the axis "
            "follows "
            f"{1e3 * part.factor:.3g} ms behind. Add velocity feedforward, or raise it where there is some; more gain "
            "makes the lag shorter, too, but costs margin."
        )
    if part.name == "velocity":
        return (
            f"{share} of the squared error of axis {axis} is in proportion to the reference's velocity: the axis runs "
            f"{-1e3 * part.factor:.3g} ms ahead. The velocity feedforward is too large: take less of it."
        )
    if part.name == "acceleration":
        more = "Add acceleration feedforward, or raise it where there is some"
        way = more if part.factor > 0.0 else "Take less acceleration feedforward"
        return f"{share} of the squared error of axis {axis} is in proportion to the reference's acceleration. {way}."
    if part.name == "direction":
        return (
            f"{share} of the squared error of axis {axis} has the sign of the direction of motion, "
            f"{abs(part.factor):.3g} {unit} to either side: that is friction. Compensate it, or add integral action."
        )
    return (
        f"{share} of the squared error of axis {axis} is an offset of {part.factor:.3g} {unit} that stays: add "
        "integral "
        "action, or raise its gain."
    )


def _chosen(run: CaseRun, axis: str, criterion: Criterion) -> np.ndarray | slice:
    """The samples that the criterion counts, or all where that cannot be said."""
    if criterion.kind in ("disturbance-error", "recovery-time") and run.fact("disturbed_from") is not None:
        return np.asarray(run.result["time"] >= run.fact("disturbed_from"))
    if criterion.kind == "steady-state-error":
        last = float(criterion.options.get("last", 0.1))
        return np.asarray(run.result["time"] >= run.result["time"][-1] - last)
    try:
        return used(run, axis, criterion.options)
    except NotMeasured:
        return slice(None)


def saturation(run: CaseRun, axis: str, chosen: np.ndarray | slice = slice(None)) -> float:
    """The share of the samples in which the controller asks for the converter's limit or more."""
    limits, name = run.fact("limits"), f"{axis}_command"
    if limits is None or name not in run.result:
        return 0.0
    asked = run.result[name][chosen]
    return float(np.mean((asked <= limits[0]) | (asked >= limits[1]))) if len(asked) else 0.0


def _swing(result: Result, axis: str, error: np.ndarray, chosen: np.ndarray | slice) -> float:
    """The frequency, Hz, at which most of the error swings, if it is well above that of the reference; else 0."""
    values, reference = error[chosen], result[f"{axis}_reference"][chosen]
    if len(values) < 16 or not np.isfinite(values).all():
        return 0.0
    power, own = (np.abs(np.fft.rfft(each - each.mean())) ** 2 for each in (values, reference))
    frequencies = np.fft.rfftfreq(len(values), result.sample_period)
    middle = float(np.sum(frequencies * own) / np.sum(own)) if np.sum(own) > 0.0 else 0.0
    fast = frequencies > _SWINGS * max(middle, frequencies[1])
    if not np.sum(power) > 0.0 or np.sum(power[fast]) < LEAST * np.sum(power):
        return 0.0
    return float(frequencies[fast][np.argmax(power[fast])])


def _panel(run: CaseRun, axis: str, error: np.ndarray, part: Part | None, unit: str) -> Panel:
    time = run.result["time"]
    curves = [Curve("error", time, error, BLUE)]
    if part is not None:
        curves.append(Curve(f"the part that follows the {part.name}", time, part.values, VERMILLION, dashes="6 3"))
    return Panel(curves, heading(f"{axis} error", unit))


def voltage_panel(run: CaseRun, axis: str) -> Panel:
    """What the controller asks for, with the converter's limits."""
    word = "command" if f"{axis}_command" in run.result else "voltage"
    levels = [(float(each), "limit") for each in run.fact("limits") or () if np.isfinite(each)]
    label = heading(f"{axis} {VOLTAGES[word]}", "V")
    curve = Curve(VOLTAGES[word], run.result["time"], run.result[f"{axis}_{word}"], BLUE)
    most = 1.5 * max((abs(level) for level, _ in levels), default=0.0) or None
    return Panel([curve], label, levels=levels, most=most)


def error_panels(run: CaseRun) -> tuple[Panel, ...]:
    """The error of the first axis and its voltage, where they can be drawn."""
    axis = run.result.axes[0]
    unit = run.result.units.get(f"{axis}_measured", "mm")
    return _panel(run, axis, error_of(run, axis), None, unit), voltage_panel(run, axis)
