"""What a model is wrong by where it matters for control: gain and phase at the intended bandwidth, delay, friction.

A good fit hides them: a time constant that is a third too long shows in a slow motion as a delay of a few milliseconds,
far below a per cent of the way. So two measures are taken, each with a standard error:

- as the axis: the structure `axis` with the model's options and a delay of either sign is fitted to the log by its
  free run, from the model's values and, where that explains too little, from those that the data say. In a closed loop
  the log is cut into stretches, each with an initial state of its own, so that a disturbance that the controller made
  up for does not add up. A constant load counts as friction that differs by direction. Model and fit are compared as
  frequency responses K e^(-jωd) / (1 + jωτ) at the intended bandwidth.
- as motion, whatever the model is: the measured position over a constant, the modelled one ŷ, its velocity and its
  acceleration, and the times for which it has moved forward and backward, by least squares (stretches of a closed loop
  have a drift of their own). y ≈ g ŷ - L dŷ/dt + Q d²ŷ/dt² is a gain and phase, too; friction that is off adds a
  constant to the velocity of each direction, and would pass for a gain without these times.

The intended bandwidth, where nobody states one, is that of a position loop on this axis without overshoot: half of 1/τ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import atan2, ceil, degrees, hypot, isfinite, pi, sqrt

import numpy as np

from rds.core.errors import InputError
from rds.identification.fit.problem import Problem
from rds.identification.fit.residuals import effective_samples
from rds.identification.fit.solve import Solution, first_state, least_squares
from rds.identification.fit.uncertainty import uncertainty_of
from rds.identification.logs.log import Log, excited_part
from rds.identification.structures.signals import POSITIONS
from rds.identification.structures.structure import Start, Structure
from rds.identification.validate.candidate import Candidate

LONGEST = 200_000  # samples
_RUNS = 40  # free runs of a search, at most
_STRETCH = (1.0, 40.0)  # s, time constants: of a stretch of a closed loop, at least
_STRETCHES = 5
_EARLY = (8, 64)  # samples by which a log's position may precede its command: at least, at most
_SURE = 0.2  # standard error of a time constant over its value, at most, for the bandwidth to follow from it
EXPLAINED = 1.5  # times the noise
_LACKING = 3.0  # times the noise: so much is left only where the axis does something that the structure lacks
_PLAYS = (2.0, 6.0)  # times the residual: widths of a play that is tried
_FAR_MORE = 0.5  # of the residual, at most, where play is what it lacks
_CHANCE = 0.01
_TOLD = 1.0  # %: standard error of a gain that the log tells
_ANY = 20.0  # %: the same, of a gain of which it tells next to nothing
_SAME = 0.1  # %: gains that differ by less are one
_LINEAR = {"tau", "K", "friction_plus", "friction_minus"}


@dataclass(frozen=True)
class Off:
    """Model minus log, with its standard error (infinite where the log does not tell), in `unit`."""

    value: float
    error: float
    unit: str
    at: float = 0.0  # Hz: of a gain that is not the one at rest


@dataclass(frozen=True)
class Discrepancy:
    """What the model is off by at `frequency` (Hz). Positive: the model has more gain, leads, has more friction.

    `lag` is the model's time constant and delay, less the log's; `delay` the delay alone. As the axis, `rmse` is what
    the model leaves of the log and `reached` the fit, in the position's unit; as motion there is no delay apart from
    the lag, and friction only of a motion both ways. A log with one level of command each way tells gain and friction
    together only: as motion there is `speed` for both.
    """

    frequency: float
    gain: Off  # %
    phase: Off  # degrees
    lag: Off  # s
    delay: Off | None = None  # s
    friction: Off | None = None  # % of the largest command
    speed: Off | None = None  # %, as motion of a log with one level of command each way
    rmse: float = 0.0
    reached: float = 0.0
    by_chance: bool = False  # whether what the model leaves is as little as the truth itself may leave beside the fit


def as_axis(candidate: Candidate, log: Log, noise: float, frequency: float = 0.0) -> Discrepancy | None:
    """The model beside the axis that fits the log best; None for a model that is no linear axis with these options.

    `frequency` (Hz) is the intended bandwidth, 0: half of 1/τ; `noise` is the measurement's.
    """
    known = _axis_of(candidate)
    if known is None or not np.ptp(log.position) > 0.0:
        return None
    made, values = known
    T = log.sample_period
    early = int(min(max(_EARLY[0], ceil(values["tau"] / T)), _EARLY[1], len(log) // 10))
    part = _advanced(excited_part(log, LONGEST), early)
    logs = stretches(part, values["tau"]) if log.closed_loop else [part]
    begun = {**values, "delay": values.get("delay", 0.0) + early * T}
    held = {name: begun[name] for name in ("viscous",) if name in begun}
    problem, own = Problem(logs, made, held, skip=early), Problem(logs, made, begun, skip=early)
    left = _search(own, own.point(begun, [first_state(made, one) for one in logs]))
    if left is None:
        return None
    states = [own.state(left.point, number) for number in range(len(logs))]
    best = _search(problem, problem.point(begun, states))
    unexplained = best is None or problem.rms(best.squares) > EXPLAINED * noise
    if unexplained and (start := _other_start(made, logs, early * T)) is not None:
        other = _search(problem, problem.point({**start[0], **held}, start[1]))
        if other is not None and (best is None or other.squares < best.squares):
            best = other
    if best is None:
        return None
    states = [problem.state(best.point, number) for number in range(len(logs))]
    again = _search(own, own.point(begun, states))  # the initial states have places of their own to stand still at
    left = left if again is None or left.squares <= again.squares else again
    if "backlash" not in made.options and not made.is_rate and problem.rms(best.squares) > _LACKING * noise:
        problem, best = _with_play(problem, best)
    covariance = uncertainty_of(problem, best).covariance[: len(problem.names), : len(problem.names)]
    here = problem.values(best.point)
    f = frequency or 1.0 / (4.0 * pi * max(_sure_of_tau(problem, here, covariance, begun["tau"]), T))
    largest = float(np.abs(log.command).max()) or 1.0

    def told(measure: str) -> Off:
        def of(point: np.ndarray) -> float:
            return _figure(
                measure, begun, {**here, **dict(zip(problem.names, point.tolist(), strict=True))}, f, largest
            )

        point = best.point[: len(problem.names)]
        value, error = of(point), error_of(of, point, covariance)
        if measure in _GAINS:  # of a ratio to a gain that the log leaves nearly infinite, derivatives say too little
            error = max(error, 100.0 * error_of(lambda p: log_of(1.0 + of(p) / 100.0), point, covariance))
        return Off(value, error, _UNITS[measure])

    gain, delay = _gain_of(told("static"), replace(told("gain"), at=f)), told("delay")
    if not gain.error < _ANY:  # where any gain would do, any delay would, even one at the edge of the search
        delay = replace(delay, error=float("inf"))
    return Discrepancy(
        frequency=f,
        gain=gain,
        phase=told("phase"),
        lag=told("lag"),
        delay=delay,
        friction=max((told(name) for name in ("forward", "backward")), key=clear),
        rmse=own.rms(left.squares),
        reached=problem.rms(best.squares),
        by_chance=own.rms(left.squares) <= EXPLAINED * float(noise)
        and by_chance(left.squares, best.squares, _worth(problem, best), len(problem.names)),
    )


def _search(problem: Problem, point: np.ndarray) -> Solution | None:
    """The end of a search; None where the free run from its start is not finite."""
    try:
        return least_squares(problem, point, _RUNS)
    except InputError:
        return None


def _with_play(problem: Problem, best: Solution) -> tuple[Problem, Solution]:
    """The fit with play, where that explains far more and tells the gain: without, a time constant makes up for it."""
    from rds.identification.structures.structures import structure

    made = problem.structure
    wider = structure("axis", (*made.options, "backlash"), made.output_unit, made.command_unit)
    found = Problem(problem.logs, wider, problem.fixed, skip=problem.skip)
    values, size = problem.values(best.point), problem.rms(best.squares)
    states = [(*problem.state(best.point, number), 0.0) for number in range(len(problem.logs))]
    starts = [({**values, "backlash": play * size}, states) for play in _PLAYS]
    ends = [_search(found, found.point(*start)) for start in starts]
    end = min((end for end in ends if end is not None), key=lambda end: end.squares, default=None)
    if end is None or end.squares > _FAR_MORE**2 * best.squares:
        return problem, best
    at = found.names.index("K")
    error = float(np.sqrt(uncertainty_of(found, end).covariance[at, at]))
    return (found, end) if 100.0 * error <= _TOLD * abs(float(end.point[at])) else (problem, best)


def _worth(problem: Problem, best: Solution) -> float:
    """How many independent samples the residuals are worth."""
    errors = [problem.residuals(best.point, number)[0][problem.skip :] for number in range(len(problem.logs))]
    return sum(effective_samples(error) for error in errors)


def by_chance(left: float, least: float, worth: float, free: int) -> bool:
    """Whether a sum of squares `left` is above the `least` by no more than chance puts the truth's there, 99 %.

    The least is over `free` parameters, and of residuals that are worth so many samples. Then nothing is wrong for
    sure, whatever derivatives at the least say: in a narrow, bent valley they say too little.
    """
    from scipy.special import chdtri

    return bool(left <= least * (1.0 + float(chdtri(free, _CHANCE)) / worth))


def _gain_of(rest: Off, bandwidth: Off) -> Off:
    """The gain at rest or at the bandwidth: the one that the log tells better; of two that it tells, the worse."""
    if rest.error <= _TOLD and bandwidth.error <= _TOLD:
        return bandwidth if abs(bandwidth.value) > abs(rest.value) + _SAME else rest
    return min((rest, bandwidth), key=lambda off: off.error)


def _sure_of_tau(problem: Problem, here: Mapping[str, float], covariance: np.ndarray, model: float) -> float:
    """The log's time constant where the log tells it, apart from a delay; else the model's."""
    at = problem.names.index("tau")
    error = float(np.sqrt(max(covariance[at, at], 0.0)))
    return here["tau"] if error <= _SURE * here["tau"] else model


_GAINS = ("gain", "static")
_UNITS = {"gain": "%", "static": "%", "phase": "°", "lag": "s", "delay": "s", "forward": "%", "backward": "%"}


def log_of(ratio: float) -> float:
    """Its logarithm; 0 for what has none: a gain of the other sign is off whatever its error."""
    return float(np.log(ratio)) if 0.0 < ratio < np.inf else 0.0


def clear(off: Off) -> float:
    return abs(off.value) / off.error if isfinite(off.error) and off.error > 0.0 else 0.0


def _figure(measure: str, model: Mapping[str, float], here: Mapping[str, float], f: float, largest: float) -> float:
    """Model less log of one measure."""
    scale = 1.0 + model.get("viscous", 0.0)
    (K, tau, delay), (K0, tau0, delay0) = ((v["K"], v["tau"] / scale, v["delay"]) for v in (model, here))
    w = 2.0 * pi * f
    if measure == "gain":
        ratio = K / K0 * hypot(1.0, w * tau0) / hypot(1.0, w * tau) if K0 != 0.0 else np.inf
        return 100.0 * (ratio - 1.0)
    if measure == "static":
        return 100.0 * (K / K0 - 1.0) if K0 != 0.0 else float("inf")
    if measure == "phase":
        return degrees(w * (delay0 - delay) + atan2(w * tau0, 1.0) - atan2(w * tau, 1.0))
    if measure == "lag":
        return tau + delay - tau0 - delay0
    if measure == "delay":
        return delay - delay0
    voltage, voltage0 = (_frictions(v)[measure] / v["K"] if v["K"] else np.inf for v in (model, here))
    return 100.0 * (voltage - voltage0) / largest


def _frictions(values: Mapping[str, float]) -> dict[str, float]:
    """Friction forward and backward in mm/s, what an offset of the command adds included."""
    if "friction" in values:
        shift = values["K"] * values.get("offset", 0.0)
        return {"forward": values["friction"] - shift, "backward": values["friction"] + shift}
    return {"forward": values["friction_plus"], "backward": -values["friction_minus"]}


def error_of(of: Callable[[np.ndarray], float], point: np.ndarray, covariance: np.ndarray) -> float:
    """The standard error of a figure: how far it moves to the ends of the axes of the covariance's ellipsoid.

    Slopes at the point would say too little where the figure is bent: a time constant near 0 has no slope in a gain.
    """
    here = of(point)
    moved = [of(point + step) != here or of(point - step) != here for step in np.diag(0.1 * _sizes(point))]
    used = np.flatnonzero(moved)
    part = covariance[np.ix_(used, used)]
    if not np.isfinite(part).all():
        return float("inf")
    spread = np.sqrt(np.maximum(np.diag(part), 0.0))
    scale = np.where(spread > 0.0, spread, 1.0)
    sizes, axes = np.linalg.eigh(part / np.outer(scale, scale))
    total = 0.0
    for size, axis in zip(sizes, axes.T, strict=True):
        step = np.zeros(len(point))
        step[used] = sqrt(max(float(size), 0.0)) * axis * spread
        total += max(abs(of(point + step) - here), abs(of(point - step) - here)) ** 2
    return sqrt(total) if isfinite(total) else float("inf")


def _sizes(point: np.ndarray) -> np.ndarray:
    return np.where(point != 0.0, np.abs(point), 1.0)


def _axis_of(candidate: Candidate) -> tuple[Structure, dict[str, float]] | None:
    """The model as the structure axis with a delay, and its values; None where it is none."""
    from rds.identification.structures.structures import structure

    made, values = candidate.structure, dict(candidate.values)
    options, signals = made.options, (made.output_unit, made.command_unit)
    if made.name in ("axis-mass", "axis-inertia") and made.as_model is not None:
        try:
            values = dict(made.as_model(values))
        except InputError:
            return None
        if values.pop("name") != "linear-axis":
            return None
        per_position = POSITIONS[made.output_unit][1]  # the library's axis has deg/s where a log has rev/min
        values |= {name: values[name] / per_position for name in _LINEAR - {"tau"}}
        options = ()
    elif made.name != "axis" and not (set(values) == _LINEAR and made.name == "linear-axis"):
        return None
    elif made.name != "axis":
        options = ()
    # friction that differs by direction, without bounds to its sign; a Stribeck part would not be each direction's own
    if not {"offset", "stribeck"} & set(options) and values["K"] != 0.0:
        forward, backward = values.pop("friction_plus"), -values.pop("friction_minus")
        values |= {"friction": (forward + backward) / 2.0, "offset": (backward - forward) / (2.0 * values["K"])}
        options = (*options, "offset")
    own = structure("axis", tuple({*options, "delay"}), *signals)
    return own, {name: float(value) for name, value in values.items()}


def _advanced(log: Log, samples: int) -> Log:
    """The log with its commands so many samples early; the last positions are left out."""
    part = log.part(0, len(log) - samples)
    return replace(part, command=log.command[samples:].copy())


def stretches(log: Log, tau: float) -> list[Log]:
    seconds = max(_STRETCH[0], _STRETCH[1] * tau)
    count = int(np.clip((log.time[-1] - log.time[0]) / seconds, 1, _STRETCHES))
    ends = np.linspace(0, len(log), count + 1).astype(int)
    return [log.part(int(a), int(b)) for a, b in pairwise(ends)]


def _other_start(made: Structure, logs: Sequence[Log], delay: float) -> Start | None:
    """Where the data by themselves say to begin; None where they hold no motion."""
    if made.start is None:
        return None
    try:
        values, states = next(iter(made.start(logs)))
    except InputError:
        return None
    return {**values, "delay": delay}, list(states)
