"""A factory of truths: machines drawn at random, a log of each, and models of it that are right or wrong.

The machine is simulated here and not by the library: velocity in exact steps of a fiftieth of a millisecond or less, a
command that arrives late by a queue of such steps, play before the encoder, noise, rounding, and, for half of them, a
controller that sees what the encoder reads. What is wrong with each model is known, and for what that matters.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import exp, log
from typing import Any

import numpy as np

from rds.core.compiling import kernel
from rds.core.errors import InputError
from rds.identification.fit.estimate import Estimate
from rds.identification.fit.fit import fit
from rds.identification.logs.findings import with_findings
from rds.identification.logs.log import Log
from rds.identification.structures.structures import structure
from rds.identification.validate.candidate import Candidate, as_candidate

FULL = 10.0  # V
_FAR = 5.0  # standard errors: beyond doubt
_STRETCHES = 5  # of a closed loop
_SUBSTEP = 5e-5  # s, at most
_DRAWS = 64  # of an encoder's rounding
_SIGNALS = ("square", "sine", "multisine", "chirp", "steps")


@dataclass(frozen=True)
class Machine:
    """What was drawn: `values` of the structure axis with `options`; the rest is how it was logged."""

    number: int
    options: tuple[str, ...]
    values: Mapping[str, float]
    period: float  # s
    noise: float  # mm
    resolution: float  # mm, 0: none
    signal: str
    closed_loop: bool
    seconds: float

    @property
    def speed(self) -> float:
        """mm/s at 60 % of the voltage."""
        return 0.6 * FULL * self.values["K"]


@dataclass(frozen=True)
class Case:
    """A model on a log. `wrong` says in what it is wrong, empty for a right one; `suffices` whether noise leaves
    enough of the log to tell a right model from one whose gain is 5 % or whose time constant is 30 % off.
    """

    machine: Machine
    candidate: Candidate
    log: Log
    kind: str
    wrong: str
    suffices: bool
    lag: float = 0.0  # s, by which a model that is wrong in it is off


def machine(number: int) -> Machine:
    """The machine with this number; the same in every run."""
    draw = np.random.default_rng([20, number])
    tau = _between(draw, 4e-3, 60e-3)
    period = float(draw.choice([p for p in (0.5e-3, 1e-3, 2e-3, 5e-3) if p <= tau / 4.0]))
    K = _between(draw, 0.5, 50.0)
    values = {"tau": tau, "K": K}
    options = []
    plus, minus = (draw.uniform(0.02, 0.12) * 0.6 * FULL * K for _ in range(2))
    values |= {"friction_plus": plus, "friction_minus": -minus}
    speed = 0.6 * FULL * K
    noise = float(draw.choice([0.0, 1.0])) * _between(draw, 1e-5, 2e-2) * speed
    resolution = float(draw.choice([1e-4, 1e-3, 5e-3, 0.02, 0.1]))
    while resolution > 1e-2 * speed:
        resolution /= 10.0
    if draw.random() < 0.25:
        options.append("stribeck")
        values |= {"stribeck": draw.uniform(0.1, 0.5), "stribeck_velocity": draw.uniform(0.02, 0.1) * speed}
    if draw.random() < 0.3:
        options.append("delay")
        values |= {"delay": max(1, round(_between(draw, 0.5e-3, 6e-3) / _substep(period))) * _substep(period)}
    if draw.random() < 0.25:
        options.append("backlash")
        values |= {"backlash": draw.uniform(8.0, 60.0) * max(resolution, noise)}
    return Machine(
        number=number,
        options=tuple(options),
        values=values,
        period=period,
        noise=noise,
        resolution=resolution,
        signal=str(draw.choice(_SIGNALS)),
        closed_loop=bool(draw.random() < 0.4),
        seconds=float(draw.uniform(5.0, 12.0)),
    )


def logged(made: Machine, seed: int, extra_delay: float = 0.0) -> Log:
    """A log of the machine; another `seed`, another command and other noise."""
    draw = np.random.default_rng([21, made.number, seed])
    n = round(made.seconds / made.period)
    t = np.arange(n) * made.period
    command = _signal(made.signal, t, draw) * FULL * draw.uniform(0.5, 0.7)
    tau, K = made.values["tau"], made.values["K"]
    late = made.values.get("delay", 0.0) + extra_delay
    p = (
        tau,
        K,
        made.values["friction_plus"],
        made.values["friction_minus"],
        made.values.get("stribeck", 0.0),
        made.values.get("stribeck_velocity", 1.0),
        late,
        made.values.get("backlash", 0.0),
    )
    substeps = round(made.period / _substep(made.period))
    noise = made.noise * draw.standard_normal(n)
    if made.closed_loop:  # the position follows a smooth reference
        gain = 0.25 / (tau + late + 2.0 * made.period) / K  # V/mm
        rate = np.convolve(command * K, np.hanning(_odd(4 * tau, made.period)), "same")
        rate *= draw.uniform(0.35, 0.5) * FULL * K / max(float(np.abs(rate).max()), 1e-9)
        reference, ahead = np.cumsum(rate) * made.period, rate / K
    else:
        gain, reference, ahead = 0.0, np.zeros(n), command
    u, y = np.empty(n), np.empty(n)
    _run(np.array(p), made.period, substeps, ahead, reference, gain, noise, made.resolution, u, y)
    return with_findings(
        Log(
            f"machine-{made.number}-{seed}",
            t,
            u,
            y,
            resolution=made.resolution,
            units={"position": "mm", "command": "V"},
            closed_loop=made.closed_loop,
        )
    )


def cases(number: int) -> Iterator[Case]:
    """The right and the wrong models of one machine, each with a log that no fit has seen."""
    made = machine(number)
    draw = np.random.default_rng([22, number])
    data = logged(made, 1)
    suffices = _suffices(made, data)

    def case(kind: str, wrong: str, values: Mapping[str, float] | None = None, log: Log = data, **more: Any) -> Case:
        options = more.get("options", made.options)
        held = dict(made.values if values is None else values)
        candidate = more.get("candidate") or Candidate(kind, structure("axis", options), held)
        return Case(made, candidate, log, kind, wrong, suffices, abs(float(more.get("lag", 0.0))))

    values = dict(made.values)
    tau, K = values["tau"], values["K"]
    up = float(draw.choice([1.0, -1.0]))
    yield case("truth", "")
    yield case("truth, a file of one's own", "", candidate=_own(made, values))
    slow, far = ({"tau": tau * factor**up} for factor in (1.3, 3.0))
    own = _own(made, values | slow)
    yield case("tau off by 30 %, a file of one's own", "lag", candidate=own, lag=tau - slow["tau"])
    yield case("K 5 % off, a file of one's own", "gain", candidate=_own(made, values | {"K": K * (1.0 + 0.05 * up)}))
    yield case("tau off by 30 %", "lag", values | slow, lag=tau - slow["tau"])
    yield case("tau three times off", "lag", values | far, lag=tau - far["tau"])
    yield case("K 5 % off", "gain", values | {"K": K * (1.0 + 0.05 * up)})
    late = max(3e-3, 0.3 * tau)
    yield case("a hidden delay", "lag", log=logged(made, 1, extra_delay=late), lag=late)
    shift = max(5, int(np.ceil(0.3 * tau / made.period)))
    y = data.position
    shifted = np.concatenate([np.full(shift, y[0]), y[:-shift]]) if up > 0 else np.append(y[shift:], [y[-1]] * shift)
    yield case(
        "a log shifted by 5 samples or more", "lag", log=replace(data, position=shifted), lag=shift * made.period
    )
    yield case("sign reversed", "sign", log=replace(data, position=-y))
    frictions = {n: values[n] * (2.0 if up > 0 else 0.3) for n in ("friction_plus", "friction_minus")}
    yield case("friction off", "friction", values | frictions)
    yield case("friction off, a file of one's own", "friction", candidate=_own(made, values | frictions))
    estimate = _fitted(made, made.options)
    if estimate is not None:
        wrong, lag = _wrong_in(made.values, estimate.values())
        if wrong != "?":
            yield case(f"fitted{', off' if wrong else ''}", wrong, candidate=as_candidate(estimate), lag=lag)
    plain = _fitted(made, ()) if made.options else None
    if plain is not None:
        wrong, lag = _wrong_in(made.values, plain.values())
        if wrong not in ("", "?"):
            yield case("fitted without options", wrong, candidate=as_candidate(plain), lag=lag)


def _fitted(made: Machine, options: Sequence[str]) -> Estimate | None:
    """The fit to another log; None where it is refused or cannot be used: without a model there is no verdict."""
    try:
        estimate = fit([logged(made, 2)], structure("axis", tuple(options)), "simulation")
    except InputError:
        return None
    return None if estimate.unusable() else estimate


def _own(made: Machine, values: Mapping[str, float]) -> Candidate:
    """A model of which nothing is known but how it answers, as of a file of one's own."""
    axis = structure("axis", made.options)
    return Candidate("own.py", replace(axis, name="own.py", sensitivities=None, options=(), start=None), dict(values))


def _suffices(made: Machine, data: Log) -> bool:
    """Whether the log tells a model from one whose gain is 5 %, or whose time constant is 30 % off, by five standard
    errors of the best estimate that there can be (Cramér and Rao's bound) while friction, play, delay and the initial
    state, the place within the play included, are not known either. In a closed loop each stretch has a state of its
    own, as disturbances that the controller makes up for do not let a free run add up.

    That bound takes the encoder's rounding for independent noise. Where an axis rests, as within its play, or moves a
    few steps only, the rounding is the same or follows the motion, sample after sample. So the standard error of least
    squares with the rounding that this motion has, wherever the encoder's steps begin, must be as small, too.
    """
    axis = structure("axis", tuple({*made.options, "delay"}))
    values = {"delay": 0.0, **made.values}
    names = list(axis.parameters)
    noise = np.hypot(made.noise, made.resolution / np.sqrt(12.0))
    stretches = max(int(made.seconds / max(1.0, 40.0 * made.values["tau"])), 1) if made.closed_loop else 1
    ends = np.linspace(0, len(data), min(stretches, _STRETCHES) + 1).astype(int)
    assert axis.sensitivities is not None
    moved, by = axis.sensitivities(data.time, data.command, (0.0,) * axis.states, values)
    misread = _misread(made, moved)
    information, scores = np.zeros((len(names), len(names))), np.zeros((len(names), misread.shape[1]))
    for first, end in pairwise(ends):
        t = data.time[first:end] - data.time[first]
        decay = np.exp(-t / made.values["tau"])
        own = np.column_stack([np.ones_like(t), decay, by[first:end, len(names) + 2 :]])
        J = by[first:end, : len(names)]
        J = J - own @ np.linalg.lstsq(own, J, rcond=None)[0]
        information += J.T @ J
        scores += J.T @ misread[first:end]
    scale = np.sqrt(np.diag(information))
    used = scale > 0.0
    if not all(used[names.index(name)] for name in ("tau", "K")):
        return False  # nothing of its motion comes out of the play
    inverse = np.zeros_like(information)
    part = np.ix_(used, used)
    inverse[part] = np.linalg.pinv(information[part] / np.outer(scale[used], scale[used]), rcond=1e-12)
    inverse[part] /= np.outer(scale[used], scale[used])
    gain = np.array([float(name == "K") for name in names])
    lag = np.array([float(name in ("tau", "delay")) for name in names])
    gain_error, lag_error = (
        max(float(noise * np.sqrt(max(row @ inverse @ row, 0.0))), float(np.std(row @ inverse @ scores)))
        for row in (gain, lag)
    )
    return gain_error <= 0.05 / _FAR * made.values["K"] and lag_error <= 0.3 / _FAR * made.values["tau"]


def _misread(made: Machine, moved: np.ndarray) -> np.ndarray:
    """By how much an encoder misreads this motion, (samples, draws): other noise, and other places of its steps."""
    draw = np.random.default_rng([23, made.number])
    phases = made.resolution * (np.arange(_DRAWS) + draw.random(_DRAWS)) / _DRAWS
    there = moved[:, None] + phases
    seen = there + made.noise * draw.standard_normal(there.shape)
    if made.resolution > 0.0:
        seen = np.rint(seen / made.resolution) * made.resolution
    return np.asarray(seen - there)


def _wrong_in(truth: Mapping[str, float], values: Mapping[str, float]) -> tuple[str, float]:
    """What a fitted model is wrong in beyond what users forgive, `?` where that is a matter of taste; and its lag."""
    lag = (values["tau"] + values.get("delay", 0.0)) - (truth["tau"] + truth.get("delay", 0.0))
    off, gain = abs(lag) / truth["tau"], abs(values["K"] / truth["K"] - 1.0)
    if gain >= 0.05:
        return "gain", lag
    if off >= 0.3 and abs(lag) >= 3e-3:
        return "lag", lag
    return "" if off <= 0.1 and gain <= 0.015 else "?", lag


def _between(draw: np.random.Generator, low: float, high: float) -> float:
    return exp(draw.uniform(log(low), log(high)))


def _substep(period: float) -> float:
    return period / max(4, int(np.ceil(period / _SUBSTEP)))


def _odd(seconds: float, period: float) -> int:
    return 2 * max(1, int(seconds / period / 2.0)) + 3


def _signal(kind: str, t: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    """From -1 to 1."""
    f = draw.uniform(0.4, 1.5)
    if kind == "square":
        return np.where(np.sin(2 * np.pi * f * t) >= 0, 1.0, -1.0) * (0.7 + 0.3 * np.cos(0.9 * t))
    if kind == "sine":
        return np.sin(2 * np.pi * f * t) * (0.8 + 0.2 * np.cos(0.7 * t))
    if kind == "multisine":
        lines = f * np.arange(1, 13)
        waves = np.sin(2 * np.pi * np.outer(t, lines) + draw.uniform(0.0, 6.28, 12))
        total = waves.sum(axis=1)
        return np.asarray(total / np.abs(total).max())
    if kind == "chirp":
        rate = (draw.uniform(8.0, 14.0) - 0.3) / t[-1]
        return np.sin(2 * np.pi * (0.3 * t + 0.5 * rate * t * t) + draw.uniform(0.0, 6.28))
    hold = max(1, round(draw.uniform(0.1, 0.4) / (t[1] - t[0])))
    levels = draw.uniform(-1.0, 1.0, len(t) // hold + 1)
    return np.repeat(levels, hold)[: len(t)]


@kernel
def _run(p, period, substeps, ahead, reference, gain, noise, resolution, u, y):
    tau, K, plus, minus, stribeck, speed, late, play = p
    h = period / substeps
    wait = round(late / h)
    queue = np.zeros(wait + 1)
    head = 0
    x = v = out = 0.0
    for k in range(len(ahead)):
        seen = out + noise[k]
        if resolution > 0.0:
            seen = np.rint(seen / resolution) * resolution
        y[k] = seen
        u[k] = min(max(ahead[k] + gain * (reference[k] - seen), -10.0), 10.0)
        for _ in range(substeps):
            queue[head] = u[k]
            head = (head + 1) % (wait + 1)
            w = queue[head]
            left = h
            for _ in range(3):  # to where the axis stops, and from there
                extra = 1.0 + (stribeck * np.exp(-((v / speed) ** 2)) if stribeck > 0.0 else 0.0)
                if v == 0.0 and minus * extra <= K * w <= plus * extra:
                    break
                forward = v > 0.0 or (v == 0.0 and K * w > 0.0)
                push = K * w - (plus if forward else minus) * extra
                new = push + (v - push) * np.exp(-left / tau)
                if v * new < 0.0:
                    way = tau * np.log((v - push) / -push)  # s until the axis stops
                    x += push * way + v * tau
                    v, left = 0.0, left - way
                    continue
                x += push * left + (v - new) * tau
                v = new
                break
            out = min(max(out, x - 0.5 * play), x + 0.5 * play)
