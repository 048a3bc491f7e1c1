"""The linear axis with Coulomb friction, solved exactly.

    τ ẍ + ẋ = K u - F_C,    F_C = F₊ while v > 0, F₋ while v < 0        (mini-cnc-rds, equations 1 to 3)

For a constant voltage and a constant sign of velocity the response is closed-form, and so is the instant at
which velocity crosses zero. An axis at rest stays at rest while F₋ <= K u <= F₊. So one sample needs at most
one crossing and no solver: a general ODE solver chatters about v = 0 or steps over it, with nothing to show it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import exp, expm1, log1p
from typing import Any

from rds.core.options import read_all
from rds.core.quantities import Quantity
from rds.core.types import Model, Source

PARAMETERS = {
    "tau": Quantity("time constant", "s", above=0.0),
    "K": Quantity("gain", "(mm/s)/V"),
    "friction_plus": Quantity("Coulomb friction F₊ while moving forward", "mm/s", low=0.0),
    "friction_minus": Quantity("Coulomb friction F₋ while moving backward, against the motion", "mm/s", high=0.0),
}


def respond(x, v, u, T, decay, reach, tau, K, plus, minus):
    """Position and velocity after `T` seconds of constant voltage `u`.

    `decay` = exp(-T/τ) and `reach` = τ (1 - decay) are handed in because they are constant in a sampled loop.
    Only arithmetic on floats: numba compiles it as it stands.
    """
    drive = K * u
    if v > 0.0 or (v == 0.0 and drive > plus):
        final = drive - plus
        end = final + (v - final) * decay
        if end >= 0.0:
            return x + final * T + (v - final) * reach, end
        # Velocity reaches zero inside the sample, at the instant when final + (v - final) e^(-t/τ) = 0.
        stop = min(tau * log1p(-v / final), T)  # rounding must not put it behind the end
        x += final * stop + v * tau
        if drive >= minus:
            return x, 0.0
        final = drive - minus
    elif v < 0.0 or drive < minus:
        final = drive - minus
        end = final + (v - final) * decay
        if end <= 0.0:
            return x + final * T + (v - final) * reach, end
        stop = min(tau * log1p(-v / final), T)
        x += final * stop + v * tau
        if drive <= plus:
            return x, 0.0
        final = drive - plus
    else:
        return x, 0.0
    gained = -expm1(-(T - stop) / tau)  # from rest, in the other direction, for the rest of the sample
    return x + final * (T - stop - tau * gained), final * gained


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float, float]:
    """The exact response over `T` s: state (position mm, velocity mm/s) and constant voltage `u` V in, state out."""
    tau = params["tau"]
    reach = -tau * expm1(-T / tau)
    return respond(
        x[0], x[1], u, T, exp(-T / tau), reach, tau, params["K"], params["friction_plus"], params["friction_minus"]
    )


def coefficients(params: Mapping[str, Any], T: float) -> tuple[float, ...]:
    """What `respond` needs after its first three arguments, for samples of `T` s."""
    tau = params["tau"]
    return (
        T,
        exp(-T / tau),
        -tau * expm1(-T / tau),
        tau,
        params["K"],
        params["friction_plus"],
        params["friction_minus"],
    )


class LinearAxisMotion:
    """The axis in motion in a loop with a fixed sample period: `contracts.Motion`."""

    __slots__ = ("_constants", "_parameters", "_tau", "position", "velocity")
    dead_time = 0.0

    def __init__(self, model: Model, T: float):
        self.position, self.velocity = (float(value) for value in model.initial_state)
        self._constants = coefficients(model.params, T)
        self._tau, self._parameters = model.params["tau"], self._constants[3:]

    def read(self) -> float:
        """Position, mm."""
        return self.position

    def write(self, voltage: float) -> None:
        """Move on by one sample of constant `voltage`, V."""
        self.position, self.velocity = respond(self.position, self.velocity, voltage, *self._constants)

    def move(self, voltage: float, time: float) -> None:
        """Move on by `time` s of constant `voltage`, V."""
        gone = -expm1(-time / self._tau)
        self.position, self.velocity = respond(
            self.position, self.velocity, voltage, time, 1.0 - gone, self._tau * gone, *self._parameters
        )


def make(**params: Any) -> Model:
    """The linear axis with the given `tau`, `K`, `friction_plus` and `friction_minus` (friction 0 if not given).

    Raises InputError for an unknown, missing or impossible parameter.
    """
    values = read_all(params, PARAMETERS, "linear-axis", {"friction_plus": 0.0, "friction_minus": 0.0})
    source = Source("linear-axis")
    return Model(advance, (0.0, 0.0), values, source=source, motion=LinearAxisMotion, has_velocity=True)
