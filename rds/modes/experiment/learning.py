"""Iterative learning control: the same motion again and again, and what was wrong in one trial corrected in the next.

    w_j+1(t) = Q [w_j(t) + gain · e_j(t + lead)]            w_1 = 0

Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE Control Systems Magazine 26 (2006) 3,
96-114. e is the tracking error of trial j. The correction w is added to the reference that the law sees, with its
derivatives; the recorded reference stays the wanted one. Q is a Gaussian low-pass without phase, which can be since a
trial is over when the next is prepared: above its cut-off the loop is left as it is, so that what the model does not
know there cannot grow.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import ceil, log, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.types import Controller, Ending, Reference, Source
from rds.modes.experiment.experiment import Experiment
from rds.modes.loop.plan import Plan
from rds.results import Result

TRIALS = Quantity("trials, the first without a correction", "", 2, 1000, default=10, whole=True)
GAIN = Quantity("part of the error that a trial adds to the correction", "", above=0.0, high=2.0, default=0.5)
LEAD = Quantity("time by which the error is taken earlier than it came", "s", 0.0, 1.0, default=0.002)
CUTOFF = Quantity("frequency at which Q lets half through", "Hz", above=0.0, default=10.0)
Trial = Callable[[int, Result], object]  # hears of a trial that has ended: its number from 1 on, its result


@dataclass(frozen=True)
class Learned:
    """What `learn` leaves: the result of each trial, and what the laws got besides their references in the last one.

    `correction` has an array in the axis's unit for each axis, a value per sample.
    """

    results: tuple[Result, ...]
    correction: dict[str, np.ndarray]

    def __repr__(self) -> str:
        units = self.results[0].units
        errors = ", ".join(
            f"{axis} from {rms[0]:.3g} to {rms[-1]:.3g} {units[f'{axis}_measured']}" for axis, rms in self.rms.items()
        )
        return f"<Learned in {len(self.results)} trials: RMS of the tracking error of {errors}>"

    @property
    def rms(self) -> dict[str, list[float]]:
        """RMS of each axis's tracking error by trial, in its unit."""
        axes = self.results[0].meta["axes"]
        return {axis: [_rms(result, axis) for result in self.results] for axis in axes}

    @property
    def converged(self) -> bool:
        """Whether no axis's last trial is worse than its first one."""
        return all(errors[-1] <= errors[0] for errors in self.rms.values())


def learn(
    experiment: Experiment | str | Path,
    trials: int = 10,
    *,
    mode: str | None = None,
    gain: float = 0.5,
    lead: float = 0.002,
    cutoff: float = 10.0,
    trial: Trial | None = None,
) -> Learned:
    """Run an experiment, or the one of a file, `trials` times in `mode`, learning from each trial.

    Any law of single axes learns, on references that are known before the run; the laws must be stable by themselves.
    `lead` (s) makes up for the time in which the loop answers: two samples for a law with feedforward, the loop's time
    constant for one without. `cutoff` in Hz. `trial(number, result)` hears of each. Raises InputError for values out of
    range and experiments that cannot learn; what a run raises comes out of here.
    """
    for name, value, declared in (
        ("trials", trials, TRIALS),
        ("gain", gain, GAIN),
        ("lead", lead, LEAD),
        ("cutoff", cutoff, CUTOFF),
    ):
        declared.check(value, name, "learn")
    experiment = Experiment.from_toml(experiment) if isinstance(experiment, str | Path) else experiment
    plan = experiment.plan(mode)
    if obstacle := _obstacle(plan):
        raise InputError(f"this experiment cannot learn: {obstacle}")
    if cutoff >= 0.5 / plan.T:
        raise InputError(f"cutoff = {cutoff:g} Hz must be below half of the sample rate, {0.5 / plan.T:g} Hz")
    corrections = {name: np.zeros(plan.samples) for name in plan.names}
    results: list[Result] = []
    trials = int(trials)  # 3.0 is a whole number, too
    for number in range(1, trials + 1):
        result = _Corrected(experiment, corrections).run(mode)
        results.append(result)
        if trial is not None:
            trial(number, result)
        if result.meta["ending"] != str(Ending.DONE):
            ended = f"trial {number} ended early ({result.meta['ending']}), and nothing can be learnt from it"
            raise InputError(f"{ended}; make the loop run to its end first, or lower --gain")
        if number < trials:
            for name in plan.names:
                error = _every_sample(result, f"{name}_reference", plan) - _every_sample(
                    result, f"{name}_measured", plan
                )
                shift = min(round(lead / plan.T), plan.samples - 1)
                early = np.concatenate([error[shift:], np.full(shift, error[-1])])
                corrections[name] = low_pass(corrections[name] + gain * early, cutoff, plan.T)
    return Learned(tuple(results), corrections)


def low_pass(values: np.ndarray, cutoff: float, T: float) -> np.ndarray:
    """Values at every `T` s through the Gaussian filter that lets half of a sine of `cutoff` Hz through, without phase.

    Beyond the ends the first and the last value are held.
    """
    sigma = sqrt(2.0 * log(2.0)) / (2.0 * pi * cutoff * T)  # samples
    reach = ceil(4.0 * sigma)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.convolve(np.pad(values, reach, mode="edge"), kernel / kernel.sum(), mode="valid")


def _obstacle(plan: Plan) -> str | None:
    if plan.program is not None:
        return "a path makes its reference while it runs; give the reference as signals"
    for axis in plan.axes:
        if axis.controller is None:
            return "a voltage signal drives it; give [reference] and [controller]"
        if axis.controller.coupled:
            return "one controller drives all its axes; learning takes single ones"
        if axis.command.quantity not in ("voltage", "velocity"):
            return f"the drive of axis {axis.axis.name} follows the reference by itself, without a law of ours"
    return None


def _every_sample(result: Result, column: str, plan: Plan) -> np.ndarray:
    """A column at every sample of the run: samples that a machine's run discarded lie on a straight line."""
    times = np.arange(plan.samples) * plan.T
    values: np.ndarray = np.interp(times, result["time"], result[column])
    return values


def _rms(result: Result, axis: str) -> float:
    error = result[f"{axis}_reference"] - result[f"{axis}_measured"]
    return float(np.sqrt(np.mean(error**2)))


class _Corrected(Experiment):
    """An experiment whose laws see corrected references."""

    def __init__(self, experiment: Experiment, corrections: Mapping[str, np.ndarray]):
        self.__dict__.update(copy.copy(experiment).__dict__)
        self._plain, self._corrections = experiment, dict(corrections)

    def _resolve(self, mode: str | None) -> tuple[Plan, dict[str, Any]]:
        plan, known = self._plain._resolve(mode)
        axes = []
        for axis in plan.axes:
            assert axis.controller is not None
            correction = self._corrections[axis.axis.name]
            axes.append(replace(axis, controller=_corrected(axis.controller, correction, plan.T)))
        return replace(plan, axes=tuple(axes)), known


def _corrected(controller: Controller, correction: np.ndarray, T: float) -> Controller:
    """The law with `correction` (axis unit, at every sample) added to its reference."""
    velocity = np.gradient(correction, T)
    rows = list(zip(correction.tolist(), velocity.tolist(), np.gradient(velocity, T).tolist(), strict=True))
    return replace(
        controller,
        control=_Control(controller.control, rows, T),
        source=Source(f"{controller.source.name}, learning", controller.source.path, controller.source.sha256),
    )


class _Control:
    """`control` of a law behind the correction of its reference; a class, so that it can go to the target process."""

    def __init__(self, control: Callable[..., Any], rows: list[tuple[float, float, float]], T: float):
        self._control, self._rows, self._T = control, rows, T

    def __call__(self, t: float, r: Reference, y: float, state: Any, params: Any) -> Any:
        p, v, a = self._rows[min(round(t / self._T), len(self._rows) - 1)]
        return self._control(t, Reference(r.position + p, r.velocity + v, r.acceleration + a), y, state, params)
