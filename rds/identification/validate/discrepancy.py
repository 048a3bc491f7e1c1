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
from rds.identification.logs.log import Log
from rds.identification.structures.structure import Start, Structure
from rds.identification.validate.candidate import Candidate

_LONGEST = 200_000  # samples
_RUNS = 40  # free runs of a search, at most
_STRETCH = (1.0, 40.0)  # s, time constants: of a stretch of a closed loop, at least
_STRETCHES = 5
_EARLY = (8, 64)  # samples by which a log's position may precede its command: at least, at most
_SURE = 0.2  # standard error of a time constant over its value, at most, for the bandwidth to follow from it
_EXPLAINED = 1.5  # times the noise
_LINEAR = {"tau", "K", "friction_plus", "friction_minus"}


@dataclass(frozen=True)
class Off:
    """Model minus log, with its standard error (infinite where the log does not tell), in `unit`."""

    value: float
    error: float
    unit: str


@dataclass(frozen=True)
class Discrepancy:
    """What the model is off by at `frequency` (Hz). Positive: the model has more gain, leads, has more friction.

    `lag` is the model's time constant and delay, less the log's; `delay` the delay alone. As the axis, `rmse` is what
    the model leaves of the log and `reached` the fit, in the position's unit; as motion there is no delay apart from
    the lag, and friction only of a motion both ways.
    """

    frequency: float
    gain: Off  # %
    phase: Off  # degrees
    lag: Off  # s
    delay: Off | None = None  # s
    friction: Off | None = None  # % of the largest command
    rmse: float = 0.0
    reached: float = 0.0


def as_axis(candidate: Candidate, log: Log, noise: float, frequency: float = 0.0) -> Discrepancy | None:
    """The model beside the axis that fits the log best; None for a model that is no linear axis with these options.

    `frequency` (Hz) is the intended bandwidth, 0: half of 1/τ; `noise` is the measurement's.
    """
    from rds.identification.fit.solve import Solution, first_state, least_squares
    from rds.identification.fit.uncertainty import uncertainty_of

    known = _axis_of(candidate)
    if known is None or not np.ptp(log.position) > 0.0:
        return None
    made, values = known
    T = log.sample_period
    early = int(min(max(_EARLY[0], ceil(values["tau"] / T)), _EARLY[1], len(log) // 10))
    part = _advanced(log.part(0, _LONGEST), early)
    logs = _stretches(part, values["tau"]) if log.closed_loop else [part]
    begun = {**values, "delay": values.get("delay", 0.0) + early * T}
    held = {name: begun[name] for name in ("viscous",) if name in begun}
    problem = Problem(logs, made, held, skip=early)

    def search(point: np.ndarray) -> Solution | None:
        try:
            return least_squares(problem, point, _RUNS)
        except InputError:  # the free run is not finite
            return None

    states = [first_state(made, one) for one in logs]
    try:
        own = Problem(logs, made, begun, skip=early)
        left = least_squares(own, own.point(begun, states), _RUNS)
    except InputError:
        return None
    states = [own.state(left.point, number) for number in range(len(logs))]
    best = search(problem.point(begun, states))
    unexplained = best is None or problem.rms(best.squares) > _EXPLAINED * noise
    if unexplained and (start := _other_start(made, logs, early * T)) is not None:
        other = search(problem.point({**start[0], **held}, start[1]))
        if other is not None and (best is None or other.squares < best.squares):
            best = other
    if best is None:
        return None
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
        return Off(of(point), _error_of(of, point, covariance), _UNITS[measure])

    return Discrepancy(
        frequency=f,
        gain=min((told("gain"), told("static")), key=lambda off: off.error),
        phase=told("phase"),
        lag=told("lag"),
        delay=told("delay"),
        friction=max((told(name) for name in ("forward", "backward")), key=_clear),
        rmse=own.rms(left.squares),
        reached=problem.rms(best.squares),
    )


def _sure_of_tau(problem: Problem, here: Mapping[str, float], covariance: np.ndarray, model: float) -> float:
    """The log's time constant where the log tells it, apart from a delay; else the model's."""
    at = problem.names.index("tau")
    error = float(np.sqrt(max(covariance[at, at], 0.0)))
    return here["tau"] if error <= _SURE * here["tau"] else model


_UNITS = {"gain": "%", "static": "%", "phase": "°", "lag": "s", "delay": "s", "forward": "%", "backward": "%"}


def _clear(off: Off) -> float:
    return abs(off.value) / off.error if isfinite(off.error) and off.error > 0.0 else 0.0


def _figure(measure: str, model: Mapping[str, float], here: Mapping[str, float], f: float, largest: float) -> float:
    """Model less log of one measure."""
    scale = 1.0 + model.get("viscous", 0.0)
    (K, tau, delay), (K0, tau0, delay0) = ((v["K"] / scale, v["tau"] / scale, v["delay"]) for v in (model, here))
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


def _error_of(of: Callable[[np.ndarray], float], point: np.ndarray, covariance: np.ndarray) -> float:
    slopes = np.zeros(len(point))
    for i, value in enumerate(point):
        step = 1e-5 * (abs(value) or 1.0)
        below, above = point.copy(), point.copy()
        below[i] -= step
        above[i] += step
        slopes[i] = (of(above) - of(below)) / (2.0 * step)
    used = slopes != 0.0
    if not np.isfinite(covariance[np.ix_(used, used)]).all():
        return float("inf")
    return sqrt(max(float(slopes[used] @ covariance[np.ix_(used, used)] @ slopes[used]), 0.0))


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
        options = ()
    elif made.name != "axis" and not (set(values) == _LINEAR and made.name == "linear-axis"):
        return None
    elif made.name != "axis":
        options = ()
    if "offset" not in options and values["K"] != 0.0:  # friction that differs by direction, without bounds to its sign
        forward, backward = values.pop("friction_plus"), -values.pop("friction_minus")
        values |= {"friction": (forward + backward) / 2.0, "offset": (backward - forward) / (2.0 * values["K"])}
        options = (*options, "offset")
    own = structure("axis", tuple({*options, "delay"}), *signals)
    return own, {name: float(value) for name, value in values.items()}


def _advanced(log: Log, samples: int) -> Log:
    """The log with its commands so many samples early; the last positions are left out."""
    part = log.part(0, len(log) - samples)
    return replace(part, command=log.command[samples:].copy())


def _stretches(log: Log, tau: float) -> list[Log]:
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


def as_motion(
    log: Log,
    first: int,
    modelled: np.ndarray,
    is_rate: bool,
    rates: Sequence[np.ndarray],
    frequency: float = 0.0,
    tau: float = 0.0,
) -> Discrepancy | None:
    """The measured motion over the modelled one, from sample `first` on; None where the model hardly moves.

    `rates` are the measured and the modelled velocity over blocks, whose ratio is the gain; `tau` the time constant of
    the model, where it has one by that name (else it is taken from how it moves).
    """
    T = log.sample_period
    t, y, u = log.time[first:][:_LONGEST], log.position[first:][:_LONGEST], log.command[first:][:_LONGEST]
    x = modelled[:_LONGEST]
    rate = x if is_rate else np.gradient(x, t)
    if not np.ptp(x) > 1e-6 * max(float(np.ptp(y)), 1e-300):
        return None
    K, tau_shown = _first_order(rate, np.gradient(rate, t), u, T)
    tau = max(tau, T) if tau > 0.0 else tau_shown
    f = frequency or 1.0 / (4.0 * pi * tau)
    change = _backward(x, T)
    ways = [sign.astype(float) for sign in _signs(x if is_rate else change)]
    columns = [x, -change, _backward(change, T), *(ways if is_rate else [np.cumsum(way) * T for way in ways])]
    stretches = len(_stretches(log.part(first, len(log)), tau)) if log.closed_loop else 1
    A = np.stack(columns, axis=1)
    residual = y.copy()
    ends = np.linspace(0, len(y), stretches + 1).astype(int)
    for a, b in pairwise(ends):  # what each stretch has of its own is taken out
        own = np.stack([np.ones(b - a), t[a:b] - t[a]], axis=1)[:, : 2 if log.closed_loop else 1]
        both = np.column_stack([A[a:b], residual[a:b]])
        both -= own @ np.linalg.lstsq(own, both, rcond=None)[0]
        A[a:b], residual[a:b] = both[:, :-1], both[:, -1]
    scale = np.linalg.norm(A, axis=0)
    kept = np.concatenate([np.ones(3, dtype=bool), scale[3:] > 1e-9 * np.linalg.norm(np.stack(columns[3:]), axis=1)])
    A, scale = A[:, kept], scale[kept]
    if not (scale > 0.0).all():
        return None
    found = np.linalg.lstsq(A / scale, residual, rcond=1e-10)[0] / scale
    error = residual - A @ found
    gram = np.linalg.pinv((A / scale).T @ (A / scale), rcond=1e-14) / np.outer(scale, scale)
    covariance = gram * float(error @ error) / effective_samples(error)
    slope = (1.0 - np.exp(-2j * pi * f * T)) / T  # of the backward difference at f

    def phase(p: np.ndarray) -> float:
        return -degrees(float(np.angle(p[0] - p[1] * slope + p[2] * slope**2)))

    return Discrepancy(
        frequency=f,
        gain=min((_gain(*rates), _gain_of_way(found, covariance)), key=lambda off: off.error),
        phase=Off(phase(found), _error_of(phase, found, covariance), "°"),
        lag=Off(-float(found[1]), sqrt(max(float(covariance[1, 1]), 0.0)), "s"),
        friction=_friction_of_ways(found, covariance, kept, K, float(np.abs(u).max())),
        rmse=float(np.sqrt(np.mean((residual - A[:, 0]) ** 2))),
        reached=float(np.sqrt(np.mean(error**2))),
    )


def _friction_of_ways(
    found: np.ndarray, covariance: np.ndarray, kept: np.ndarray, K: float, largest: float
) -> Off | None:
    """What the velocities of each direction lack, as friction in % of the largest command; None where not known.

    With v = K u - F of the model and v' = g v + c of the log, c is g F - F', and (F/K - F'/(g K)) = c / (g K).
    """
    scale = float(found[0]) * K * largest / 100.0
    if not (kept[3:].all() and scale > 0.0):
        return None
    forward, backward = (
        Off(sign * float(found[at]) / scale, sqrt(max(float(covariance[at, at]), 0.0)) / scale, "%")
        for at, sign in ((3, 1.0), (4, -1.0))
    )
    return max(forward, backward, key=_clear)


def _backward(x: np.ndarray, T: float) -> np.ndarray:
    """The backward difference over T. No later sample is in it: in a closed loop the command at a sample answers the
    noise that the encoder read there, and a central difference would explain that noise by itself.
    """
    return np.diff(x, prepend=2.0 * x[0] - x[1]) / T


def _gain_of_way(found: np.ndarray, covariance: np.ndarray) -> Off:
    """The same by the positions themselves, which tell more where noise hides the velocity."""
    if not found[0] > 0.0:
        return Off(0.0, float("inf"), "%")
    spread = sqrt(max(float(covariance[0, 0]), 0.0))
    return Off(100.0 * (1.0 / float(found[0]) - 1.0), 100.0 * spread / float(found[0]) ** 2, "%")


def _signs(rate: np.ndarray) -> list[np.ndarray]:
    """Where it is forward, and where backward, each (n,) of bool; at rest neither."""
    least = 1e-6 * float(np.abs(rate).max())
    return [rate > least, rate < -least]


def _gain(measured: np.ndarray, modelled: np.ndarray) -> Off:
    """By how many per cent the model's velocity is too large, friction of each direction apart."""
    ways = np.stack(_signs(modelled), axis=1).astype(float)
    own = modelled - ways @ np.linalg.lstsq(ways, modelled, rcond=None)[0]
    size = float(own @ own)
    if not size > 1e-12 * float(modelled @ modelled):
        return Off(0.0, float("inf"), "%")
    ratio = float(measured @ own) / size
    error = measured - ratio * own
    error -= ways @ np.linalg.lstsq(ways, error, rcond=None)[0]
    spread = sqrt(float(error @ error) / (size * max(effective_samples(error) / len(error), 1e-3)) / len(error))
    if not ratio > 0.0:
        return Off(float("inf"), 0.0, "%")
    return Off(100.0 * (1.0 / ratio - 1.0), 100.0 * spread / ratio**2, "%")


def _first_order(rate: np.ndarray, change: np.ndarray, u: np.ndarray, T: float) -> tuple[float, float]:
    """Gain (unit/s per V) and time constant (s) of the model, by its own motion: rate = K u - τ change - friction."""
    A = np.stack([u, -change, -np.sign(rate), np.ones(len(u))], axis=1)
    K, tau = np.linalg.lstsq(A, rate, rcond=1e-9)[0][:2]
    return float(K), float(np.clip(tau, 2.0 * T, 10.0))
