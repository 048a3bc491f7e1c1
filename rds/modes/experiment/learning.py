"""Iterative learning control: the same motion again and again, and what was wrong in one trial corrected in the next.

    w_j+1(t) = Q [w_j(t) + gain · e_j(t + lead)]            w_1 = 0

Bristow, Tharayil, Alleyne, "A survey of iterative learning control", IEEE Control Systems Magazine 26 (2006) 3,
96-114. e is the tracking error of trial j. The correction w is added to the reference that the law sees, with its
derivatives; the recorded reference stays the wanted one. Q is a Gaussian low-pass without phase, which can be since a
trial is over when the next is prepared: above its cut-off the loop is left as it is, so that what the model does not
know there cannot grow. Where the voltage was at its limit nothing is added: more correction would only wind up.

Errors shrink from trial to trial where |Q(ω)| |1 - gain e^(iω lead) T(iω)| < 1 at every frequency, T being the closed
loop from the reference to the axis; that is known when the trials have been run.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import ceil, cos, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.types import Controller, Ending, Reference, Source, Verdict
from rds.machines.converter import limits
from rds.modes.experiment.experiment import Experiment
from rds.modes.loop.plan import AxisPlan, Plan
from rds.results import Result

TRIALS = Quantity("trials, the first without a correction", "", 2, 1000, default=10, whole=True)
GAIN = Quantity("part of the error that a trial adds to the correction", "", above=0.0, high=2.0, default=0.5)
LEAD = Quantity("time by which the error is taken earlier than it came", "s", 0.0, 1.0)
CUTOFF = Quantity("frequency at which Q lets half through", "Hz", above=0.0, default=10.0)
LEAD_SAMPLES = 2  # by default: from a voltage to the position that it moves, and half of what a difference is late
_LOWEST = 0.1  # periods of the cut-off in a trial
_WORSE, _GROWN = 1.01, 1.5  # times the first error, and the least one: two trials on a machine differ by less
_WOUND = 0.01  # of a trial at the limit deserves a note
Trial = Callable[[int, Result], object]  # hears of a trial that has ended: its number from 1 on, its result


@dataclass(frozen=True)
class Learned:
    """What `learn` leaves: the result of each trial, and what the laws got besides their references in the last one.

    `correction` has an array in the axis's unit for each axis, a value per sample; `limited` says at which samples the
    command of the last trial was at its limit.
    """

    results: tuple[Result, ...]
    correction: dict[str, np.ndarray]
    limited: dict[str, np.ndarray]

    def __repr__(self) -> str:
        units = self.results[0].units
        errors = ", ".join(
            f"{axis} from {rms[0]:.3g} to {rms[-1]:.3g} {units[f'{axis}_measured']}" for axis, rms in self.rms.items()
        )
        return f"<Learned in {len(self.results)} trials: RMS of the tracking error of {errors}>"

    @property
    def rms(self) -> dict[str, list[float]]:
        """RMS of each axis's tracking error by trial, in its unit, over the whole of it: the first period, too."""
        axes = self.results[0].meta["axes"]
        return {axis: [_rms(result, axis) for result in self.results] for axis in axes}

    @property
    def converged(self) -> bool:
        """Whether no axis's last trial is over 1 % worse than its first one, nor half as bad again as its best one."""
        return not any(map(_grows, self.rms.values()))

    @property
    def notes(self) -> list[str]:
        """What to know of the trials, a sentence each: where the timing was off, errors grew, or voltages were at their
        limits.
        """
        said = [
            f"the timing of trial {number} was {result.verdict}: {result.meta.get('verdict_reason')}. Its error may be "
            f"that of the late samples{', and the next trials have learnt from it' * (number < len(self.results))}"
            for number, result in enumerate(self.results, 1)
            if result.verdict not in (None, Verdict.MET)
        ]
        for axis, errors in self.rms.items():
            unit = self.results[0].units[f"{axis}_measured"]
            best = errors.index(min(errors))
            if _grows(errors):
                said.append(
                    f"{axis}: the error grows: it was least in trial {best + 1} ({errors[best]:.4g} {unit}) and is "
                    f"{errors[-1]:.4g} {unit} in trial {len(errors)}; lower the cutoff or the gain, choose another "
                    "lead, or end earlier"
                )
            if (share := float(self.limited[axis].mean())) > _WOUND:
                moves = np.ptp(self.results[-1][f"{axis}_reference"]) > 0.0
                said.append(
                    f"{axis}: the command was at its limit in {100.0 * share:.0f} % of the last trial, where nothing "
                    f"can be learnt; {'ask for a slower motion' if moves else 'lower the gains of the law'}"
                )
        return said


def learn(
    experiment: Experiment | str | Path,
    trials: int = 10,
    *,
    mode: str | None = None,
    gain: float = 0.5,
    lead: float | None = None,
    cutoff: float = 10.0,
    trial: Trial | None = None,
) -> Learned:
    """Run an experiment, or the one of a file, `trials` times in `mode`, learning from each trial.

    Any law of single axes learns, on references that are known before the run; the laws must be stable by themselves.
    `lead` (s, rounded to whole samples) makes up for the time in which the loop answers: two samples (the default) for
    a law with feedforward, the loop's time constant for one without. `cutoff` in Hz. `trial(number, result)` hears of
    each. Raises InputError for values out of range and experiments that cannot learn; what a run raises comes out of
    here.
    """
    for name, value, declared in (
        ("trials", trials, TRIALS),
        ("gain", gain, GAIN),
        ("lead", 0.0 if lead is None else lead, LEAD),
        ("cutoff", cutoff, CUTOFF),
    ):
        declared.check(value, name, "learn")
    experiment = Experiment.from_toml(experiment) if isinstance(experiment, str | Path) else experiment
    if not isinstance(experiment, Experiment):
        raise InputError(f"learn takes an Experiment, or the name of its file, and not {experiment!r:.60}")
    plan = experiment.plan(mode)
    if obstacle := _obstacle(plan):
        raise InputError(f"this experiment cannot learn: {obstacle}")
    if cutoff >= 0.5 / plan.T:
        raise InputError(f"cutoff = {cutoff:g} Hz must be below half of the sample rate, {0.5 / plan.T:g} Hz")
    shift = LEAD_SAMPLES if lead is None else round(lead / plan.T)
    if shift >= plan.samples and lead is not None:
        raise InputError(f"lead = {lead:g} s must be shorter than a trial, {plan.samples * plan.T:g} s")
    shift = min(shift, plan.samples - 1)
    if cutoff * plan.samples * plan.T < _LOWEST:
        lowest = _LOWEST / (plan.samples * plan.T)
        raise InputError(
            f"cutoff = {cutoff:g} Hz is too low for a trial of {_LOWEST / lowest:g} s; give {lowest:g} or more"
        )
    corrections = {name: np.zeros(plan.samples) for name in plan.names}
    limited: dict[str, np.ndarray] = {}
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
        for axis in plan.axes:
            name = axis.axis.name
            limited[name] = at_limit = _at_limit(result, axis, plan)
            if number < trials:
                error = _every_sample(result, f"{name}_reference", plan) - _every_sample(
                    result, f"{name}_measured", plan
                )
                early = np.concatenate([error[shift:], np.full(shift, error[-1])])
                corrections[name] = low_pass(
                    corrections[name] + np.where(_within(at_limit, shift), 0.0, gain * early), cutoff, plan.T
                )
    return Learned(tuple(results), corrections, limited)


def low_pass(values: np.ndarray, cutoff: float, T: float) -> np.ndarray:
    """Values at every `T` s through the Gaussian filter that lets half of a sine of `cutoff` Hz through, without phase.

    Of sampled values it is 2^(-(1 - cos ωT)/(1 - cos ω_c T)), which is half at any cut-off up to Nyquist's frequency.
    Beyond the ends the first and the last value are held.
    """
    bend = 1.0 - cos(2.0 * pi * cutoff * T)
    reach = ceil(6.0 / sqrt(bend)) + 4  # more than six standard deviations
    held = np.pad(values, reach, mode="edge")
    angles = 2.0 * pi * np.fft.rfftfreq(len(held))
    through = 2.0 ** (-(1.0 - np.cos(angles)) / bend)
    return np.fft.irfft(np.fft.rfft(held) * through, len(held))[reach:-reach]


def _at_limit(result: Result, axis: AxisPlan, plan: Plan) -> np.ndarray:
    """At which samples of the run the law asked for all that there is, or more."""
    board = plan.machine.converter
    low, high, _ = limits(board.range, board.bits, saturation=plan.saturation, quantization=plan.quantization)
    if axis.command.quantity != "voltage":
        low, high = -axis.most_target, axis.most_target
    own = axis.controller.params.get("maxoutput") if axis.controller is not None else None
    if isinstance(own, float) and own > 0.0:  # of a law of the library that limits itself
        low, high = max(low, -own), min(high, own)
    command = _every_sample(result, f"{axis.axis.name}_command", plan)
    return np.asarray((command <= low) | (command >= high))


def _within(flags: np.ndarray, samples: int) -> np.ndarray:
    """Whether any flag is set from each sample on to so many later."""
    so_far = np.concatenate([[0], np.cumsum(flags)])
    ends = np.minimum(np.arange(len(flags)) + samples + 1, len(flags))
    return np.asarray(so_far[ends] > so_far[:-1])


def _grows(errors: list[float]) -> bool:
    return not errors[-1] <= min(_WORSE * errors[0], _GROWN * min(errors))


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
