"""Which voltage tells an axis's parameters best, within its travel and its voltage: optimal experiment design.

For a signal u, the sensitivities S of the output by parameters and initial state (samples, n), and white noise of
variance σ² (the encoder's rounding q²/12 and what else is stated), the fit of the free run will have the covariance

    σ² (Sᵀ S)⁻¹        (inverse of Fisher's information)

So what a signal is worth is known before it is sent, as far as the assumed parameters are near the true ones. Signals
are tried over a grid of kinds, amplitudes, frequencies and offsets. The best is that whose worst relative standard
error is least; their geometric mean along the axes of the confidence ellipsoid (D-optimality) stands beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.core.quantities import Quantity
from rds.identification.structures.structure import Structure
from rds.machines.machine import Axis, Machine
from rds.references import Signal, make_signal, sample_voltage

KINDS = ("square", "sinusoid", "staircase", "multisine", "chirp")
_VOLTAGE = 0.9  # of the converter's range: so that nothing saturates
_TRAVEL = 0.9  # of the travel to each side
_AMPLITUDES = (0.2, 0.4, 0.6, 0.8, 1.0)  # of the voltage that may be used
_FREQUENCIES = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0)  # Hz
_HIGHEST = (5.0, 15.0, 40.0)  # Hz, of multisine and chirp
_STEPS = (2, 4)
_MOST_SAMPLES = 200_000
_OPTIONS = {
    "duration": Quantity("length of the test", "s", above=0.0),
    "noise": Quantity("standard deviation of the output's noise beside rounding", "mm (rev/min)", low=0.0),
}


@dataclass(frozen=True)
class Task:
    """What a test is designed for. Values are those assumed of the axis; noise is in the output's unit."""

    machine: Machine
    axis: Axis
    structure: Structure
    values: Mapping[str, float]
    duration: float  # s
    noise: float  # standard deviation of the output, rounding included

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters that a test is to tell."""
        return tuple(self.structure.parameters)

    @property
    def samples(self) -> int:
        """How many there are."""
        return round(self.duration / self.machine.sample_period)

    def scale(self, name: str) -> float:
        """What a parameter's error is compared with: its value, or, where it is zero, that of its kind."""
        value = abs(self.values[name])
        if value > 0.0:
            return value
        units = self.structure.units
        return max((abs(v) for other, v in self.values.items() if units[other] == units[name]), default=0.0) or 1.0


@dataclass(frozen=True)
class Prediction:
    """What a signal would tell. `std_errors` are in the parameters' units; `percent` relative to their scale."""

    signal: Signal
    std_errors: Mapping[str, float]
    percent: Mapping[str, float]
    worst_percent: float
    mean_percent: float  # geometric mean along the ellipsoid's axes: D-optimality
    travel: tuple[float, float]  # mm (rev/min)
    peak_voltage: float
    fits: bool  # within travel and voltage

    @property
    def table(self) -> dict[str, Any]:
        """The `[signal]` table of an experiment."""
        return {"kind": self.signal.kind, **self.signal.settings}


@dataclass(frozen=True)
class Design:
    """The predictions for all signals that fit, best first; `tried` counts those that do not as well."""

    task: Task
    ranked: tuple[Prediction, ...]
    tried: int

    @property
    def best(self) -> Prediction:
        """The signal to take."""
        return self.ranked[0]

    def best_of_kinds(self) -> list[Prediction]:
        """The best of each kind, best first."""
        firsts: dict[str, Prediction] = {}
        for prediction in self.ranked:
            firsts.setdefault(prediction.signal.kind, prediction)
        return list(firsts.values())


def make_task(
    machine: Machine,
    axis: str,
    structure: Structure,
    values: Mapping[str, float],
    duration: float = 10.0,
    noise: float = 0.0,
) -> Task:
    """The task for an axis of a machine, with the `values` assumed; InputError for what cannot be."""
    length = _OPTIONS["duration"].check(duration, "duration", "excite")
    extra = _OPTIONS["noise"].check(noise, "noise", "excite")
    found = machine.axis(axis)
    samples = round(min(length / machine.sample_period, 1e18))  # infinity is not rounded
    if not 100 <= samples <= _MOST_SAMPLES:
        raise InputError(
            f"excite: duration = {length:g} s makes {samples} samples; take 100 to {_MOST_SAMPLES} of "
            f"{machine.sample_period:g} s"
        )
    if structure.output_unit != found.unit:
        raise InputError(
            f"excite: the model is of an axis in {structure.output_unit}, and axis {axis} of the machine is in "
            f"{found.unit}; name the axis that it is of (--axis)"
        )
    if structure.sensitivities is None:
        raise InputError(f"excite: structure {structure.name} has no derivatives; take axis, axis-mass or spindle")
    sigma = float(np.hypot(found.resolution / np.sqrt(12.0), extra))
    return Task(machine, found, structure, dict(values), length, sigma)


def predict(task: Task, signal: Signal) -> Prediction:
    """What `signal`, sent from rest at position 0, would tell. InputError if it is too fast for the sampling."""
    T = task.machine.sample_period
    u = sample_voltage(signal, T, task.samples)
    t = np.arange(task.samples) * T
    assert task.structure.sensitivities is not None
    output, slopes = task.structure.sensitivities(t, u, [0.0] * task.structure.states, task.values)
    count = len(task.parameters)
    scales = np.array([task.scale(name) for name in task.parameters])
    covariance = _covariance(slopes, count, scales) * task.noise**2
    relative = 100.0 * np.sqrt(np.diag(covariance))
    sign, log_det = np.linalg.slogdet(covariance) if np.isfinite(covariance).all() else (1.0, np.inf)
    low, high = float(output.min()), float(output.max())
    peak = float(np.abs(u).max())
    within = (
        peak <= _VOLTAGE * task.machine.converter.range * (1.0 + 1e-9)
        and low >= _TRAVEL * task.axis.travel[0]
        and high <= _TRAVEL * task.axis.travel[1]
    )
    return Prediction(
        signal=signal,
        std_errors=dict(zip(task.parameters, (relative / 100.0 * scales).tolist(), strict=True)),
        percent=dict(zip(task.parameters, relative.tolist(), strict=True)),
        worst_percent=float(relative.max()),
        mean_percent=float(100.0 * np.exp(log_det / (2.0 * count))) if sign > 0 else float("inf"),
        travel=(low, high),
        peak_voltage=peak,
        fits=within,
    )


def _covariance(slopes: np.ndarray, count: int, scales: np.ndarray) -> np.ndarray:
    """Of the first `count` columns over their scales, for noise of 1; infinite where nothing tells them apart."""
    J = slopes.copy()
    J[:, :count] *= scales
    size = np.linalg.norm(J, axis=0)
    told = size > 0.0
    if not told[:count].all():
        return np.full((count, count), np.inf)
    J = J[:, told] / size[told]
    triangle = np.linalg.qr(J, mode="r")
    if np.abs(np.diag(triangle)).min() < 1e-9:
        return np.full((count, count), np.inf)
    inverse = np.linalg.inv(triangle)
    covariance = (inverse @ inverse.T)[:count, :count]
    return np.asarray(covariance / np.outer(size[:count], size[:count]))


def design(task: Task, kinds: Sequence[str] = KINDS, progress: Progress | None = None) -> Design:
    """Try the grid of signals. InputError for an unknown kind, or if none fits the axis and tells its parameters."""
    for kind in kinds:
        if kind not in KINDS:
            raise InputError(f"excite: signal kind {kind!r} is not known; known: {', '.join(KINDS)}")
    signals = list(candidates(task, kinds))
    found = []
    for number, signal in enumerate(signals):
        prediction = predict(task, signal)
        if prediction.fits and np.isfinite(prediction.worst_percent):
            found.append(prediction)
        if progress is not None:
            progress(number + 1, len(signals))
    if not found:
        low, high = task.axis.travel
        raise InputError(
            f"none of {len(signals)} signals keeps {task.axis.name} within {_TRAVEL:.0%} of its travel ({low:g} to "
            f"{high:g} {task.axis.unit}) for {task.duration:g} s and tells all its parameters; give a shorter "
            "--duration, or check the assumed gain"
        )
    found.sort(key=lambda prediction: prediction.worst_percent)
    return Design(task, tuple(found), len(signals))


def candidates(task: Task, kinds: Sequence[str]) -> Iterator[Signal]:
    """The grid: each kind over amplitudes, frequencies and offsets, as far as duration and sampling allow."""
    usable = _VOLTAGE * task.machine.converter.range
    slowest, fastest = 2.0 / task.duration, 0.1 / task.machine.sample_period
    frequencies = [f for f in _FREQUENCIES if slowest <= f <= fastest] or [slowest]
    highest = [f for f in _HIGHEST if f <= fastest] or [fastest]
    for offset in _offsets(task, usable):
        for share in _AMPLITUDES:
            amplitude = round(share * (usable - abs(offset)), 3)
            level = {"amplitude": amplitude, "offset": offset}
            for kind in kinds:
                yield from _of_kind(kind, level, frequencies, highest, task)


def _of_kind(
    kind: str, level: dict[str, float], frequencies: Sequence[float], highest: Sequence[float], task: Task
) -> Iterator[Signal]:
    if kind in ("multisine", "chirp"):
        for low in (f for f in frequencies if f <= 1.0):
            for high in highest:
                band = {"lowest": low, "highest": high}
                if kind == "multisine":
                    yield make_signal(kind, **level, **band, frequency=low)
                else:
                    yield make_signal(kind, **level, **band, sweep=round(0.5 * task.duration, 3))
        return
    for frequency in frequencies:
        for steps in _STEPS if kind == "staircase" else (0,):
            if not steps:
                yield make_signal(kind, **level, frequency=frequency)
            elif 4 * steps * frequency * task.machine.sample_period <= 0.1:  # ten samples a level
                yield make_signal(kind, **level, frequency=frequency, steps=steps)


def _offsets(task: Task, usable: float) -> list[float]:
    """None; for an axis also that which makes up for friction that differs by direction; for a spindle half of all."""
    if task.structure.output_unit == "rev/min":
        return [0.0, round(0.5 * usable, 3)]
    values = task.values
    if "friction_plus" in values and values["K"]:
        balance = (values["friction_plus"] + values["friction_minus"]) / (2.0 * values["K"])
        return [0.0, round(balance, 3)] if abs(balance) >= 1e-3 else [0.0]
    return [0.0]
