"""A tracking controller as it is being designed: gains, step response, margins, and a cloud of what its axis may be.

Everything is of the sampled loop that would run: the law and the observer are those of `rds.controllers.tracking`,
margins and poles those of `rds.identification.robustness.margins`, about rest. Light enough to follow a pole
that is being dragged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import ceil, pi
from typing import Any

import numpy as np

from rds.controllers import tracking
from rds.core.errors import InputError
from rds.core.linear_law import Law
from rds.core.types import Controller, Model, Reference
from rds.identification.fit.design import Linear, design_tracking
from rds.identification.robustness.draws import Spread, draws
from rds.identification.robustness.figures import MARGINS
from rds.identification.robustness.margins import closed_poles, law_about_rest, loop_margins, open_loop
from rds.models import library_model

LONGEST = 10.0  # s of a step response
_SETTLED = 0.02  # of the step
_TIMES = 8.0  # time constants of the slowest pole that a step response shows
_GRID = 240  # frequencies of a loop that is drawn


@dataclass(frozen=True)
class StepResponse:
    """The answer of controller and axis to a step of the reference, sample by sample."""

    time: np.ndarray  # s
    size: float  # mm, of the step
    position: np.ndarray  # mm
    voltage: np.ndarray  # V, after saturation

    @property
    def overshoot(self) -> float:
        """% of the step beyond it."""
        return max(0.0, 100.0 * (float((self.position / self.size).max()) - 1.0))

    @property
    def settling(self) -> float | None:
        """s until it stays within 2 % of the step; None if it does not in the time that is shown."""
        off = np.abs(self.position / self.size - 1.0) > _SETTLED
        if off[-1]:
            return None
        return float(self.time[int(np.flatnonzero(off)[-1]) + 1]) if off.any() else 0.0

    @property
    def remaining(self) -> float:
        """mm that are missing at the end: what friction holds back."""
        return self.size - float(self.position[-1])


@dataclass(frozen=True)
class LoopDraws:
    """The loop over draws of the axis: `margins` (draws, 4) as in `figures.MARGINS`, `poles` (draws, poles) in 1/s."""

    spread: Spread
    margins: np.ndarray
    poles: np.ndarray

    @property
    def unstable(self) -> int:
        """How many of the draws have an unstable loop."""
        return int(np.count_nonzero(~(self.margins[:, 3] < 1.0)))

    @property
    def worst(self) -> dict[str, float]:
        """The worst of each margin among the stable loops; NaN where no loop is stable."""
        stable = self.margins[self.margins[:, 3] < 1.0]
        if not len(stable):
            return dict.fromkeys(MARGINS, float("nan"))
        found = [stable[:, k].max() if more else stable[:, k].min() for k, (_, _, more) in enumerate(MARGINS.values())]
        return dict(zip(MARGINS, map(float, found), strict=True))


@dataclass(frozen=True)
class TrackingDesign:
    """The tracking controller of `axis` for these poles (1/s), sampled every `T` s; `model` stands for the axis."""

    axis: Linear
    model: Model
    controller: Controller
    poles: tuple[complex, complex]
    observer_pole: float
    T: float

    @property
    def gains(self) -> dict[str, float]:
        """g1 (1/s²) and g2 (1/s) of the law, and L (1/s), F, G (1/s), H ((mm/s)/V) of its observer."""
        return {name: float(self.controller.params[name]) for name in ("g1", "g2", "L", "F", "G", "H")}

    @property
    def damping(self) -> float:
        """ζ of the pair of poles; of two real poles (1 or more) that of the equation they solve."""
        return -(self.poles[0] + self.poles[1]).real / (2.0 * self.frequency)

    @property
    def frequency(self) -> float:
        """Natural frequency of the pair, rad/s."""
        return float(np.sqrt(abs(self.poles[0] * self.poles[1])))

    @cached_property
    def law(self) -> Law:
        """The controller about rest."""
        found = law_about_rest(self.controller)
        assert found is not None  # the tracking law is linear
        return found

    @cached_property
    def margins(self) -> dict[str, float]:
        """Gain margin (dB), phase margin (°), modulus margin and largest |z| of the loop."""
        row = loop_margins(self.law, [self.model], self.T)[0]
        return dict(zip(MARGINS, map(float, row), strict=True))

    @cached_property
    def closed_poles(self) -> np.ndarray:
        """The sampled loop's poles, as those of the continuous motion that they are samples of, 1/s."""
        return continuous(closed_poles(self.law, [self.model], self.T), self.T)[0]

    def loop(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies (rad/s, up to Nyquist's) and the complex loop there."""
        low = min(abs(self.poles[0]), abs(self.poles[1]), 1.0 / self.axis.tau) / 50.0
        w = np.geomspace(min(low, 0.01 * pi / self.T), pi / self.T, _GRID)
        return w, open_loop(self.law, self.model, self.T, w)

    def step(self, size: float = 1.0, friction: bool = True) -> StepResponse:
        """The response to a step of `size` mm; without `friction` of the linear axis alone."""
        slowest = min(-pole.real for pole in self.poles)
        samples = ceil(min(_TIMES / slowest + 2.0 * self.axis.tau, LONGEST) / self.T)
        model = self.model if friction else library_model("linear-axis", tau=self.axis.tau, K=self.axis.K)
        return step_response(self.controller, model, self.T, samples, size)

    def cloud(self, spread: Spread, number: int = 200, seed: int = 1) -> LoopDraws:
        """Margins and poles over `number` draws of `spread`, whose parameters are those of the machine's own axis."""
        rows = draws(spread, seed, 0, number)
        models = [
            library_model("machine-axis", **dict(zip(spread.names, map(float, row), strict=True))) for row in rows
        ]
        margins = loop_margins(self.law, models, self.T)
        return LoopDraws(spread, margins, continuous(closed_poles(self.law, models, self.T), self.T))


def tracking_design(
    axis: Linear,
    *,
    model: Model | None = None,
    sample_period: float = 0.001,
    poles: Any = tracking.POLES,
    observer_pole: float = tracking.OBSERVER_POLE,
    voltage_range: float = 10.0,
) -> TrackingDesign:
    """The design for `axis`; `model` is what it is tried on (default: τ and K alone).

    InputError for poles that are not stable, not conjugate, or too fast for the sample period.
    """
    from rds.controllers.design import read_poles

    first, second = read_poles(poles, 2, "design")
    made = design_tracking(
        axis,
        sample_period=sample_period,
        poles=[first, second],
        observer_pole=observer_pole,
        voltage_range=voltage_range,
    )
    tried = model or library_model("linear-axis", tau=axis.tau, K=axis.K)
    return TrackingDesign(axis, tried, made, (first, second), float(observer_pole), sample_period)


def step_response(controller: Controller, model: Model, T: float, samples: int, size: float) -> StepResponse:
    """Controller and model sample by sample, from rest at 0, the reference at `size` mm from the first sample on."""
    if not size > 0.0:
        raise InputError(f"the step must be more than 0 mm, not {size:g}")
    assert model.motion is not None  # of all library models
    motion, params, state = model.motion(model, T), dict(controller.params), controller.initial_state
    reference = Reference(size, 0.0, 0.0)
    position, voltage = np.empty(samples), np.empty(samples)
    for k in range(samples):
        position[k] = y = motion.read()
        u, state = controller.control(k * T, reference, y, state, params)
        voltage[k] = u
        motion.write(u)
    return StepResponse(np.arange(samples) * T, size, position, voltage)


def continuous(z: np.ndarray, T: float) -> np.ndarray:
    """ln(z)/T, 1/s: the poles of which `z` are the samples. Poles at 0, which are pure delay, are NaN."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(np.abs(z) > 1e-9, np.log(z) / T, np.nan)


def sampled_limit(tau: float, K: float, T: float, angles: np.ndarray) -> np.ndarray:
    """|p| (rad/s) from which a pair of poles at these angles (rad, from the negative real axis) is unstable.

    Poles that are stable on paper make a loop unstable that is sampled too seldom for them: by bisection.
    """
    low, high = np.zeros_like(angles), np.full_like(angles, 100.0 / T)
    for _ in range(50):
        middle = 0.5 * (low + high)
        stable = tracking.is_sampled_stable(tau, K, T, middle**2, 2.0 * middle * np.cos(angles) - 1.0 / tau)
        low, high = np.where(stable, middle, low), np.where(stable, high, middle)
    return low
