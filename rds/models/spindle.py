"""The spindle: a first-order speed loop, solved exactly.

    τ v̇ + v = K (u(t - L) + u₀)        v in rev/min, u in V

Over a time h of constant voltage, v⁺ = K u + (v - K u) e^(-h/τ). The offset u₀ is what friction of a spindle that turns
one way takes; the dead time L need not be a whole number of samples.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import exp
from typing import Any

from rds.core.options import read_all
from rds.core.quantities import Quantity
from rds.core.types import Model, Source
from rds.models.machine_model import split_delay

PARAMETERS = {
    "tau": Quantity("time constant", "s", above=0.0),
    "K": Quantity("gain", "(rev/min)/V"),
    "offset": Quantity("voltage that acts beside the command", "V"),
    "delay": Quantity("dead time from a command to its effect", "s", 0.0, 1000.0),
}
_NEUTRAL = {"offset": 0.0, "delay": 0.0}


def coefficients(params: Mapping[str, Any], T: float) -> tuple[float, float, float, float]:
    """What `sampled` needs after its first three arguments, for samples of `T` s."""
    _, left = split_delay(params["delay"], T)
    return params["K"], params["offset"], exp(-left / params["tau"]), exp(-(T - left) / params["tau"])


def sampled(speed, before, now, K, offset, first, rest):
    """The speed after one sample: the voltage `before` acts while its part decays to `first`, `now` for the rest."""
    if first < 1.0:
        final = K * (before + offset)
        speed = final + (speed - final) * first
    final = K * (now + offset)
    return final + (speed - final) * rest


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float, ...]:
    """The exact response over `T` s: state and constant voltage `u` V in, state out.

    The state is the speed (rev/min) and, with a delay, the voltages that still wait, latest first; those that are not
    there are 0 V.
    """
    whole, left = split_delay(params["delay"], T)
    waiting = (u, *x[1:])
    before, now = (waiting[at] if at < len(waiting) else 0.0 for at in (whole + 1, whole))
    return (sampled(x[0], before, now, *coefficients(params, T)), *waiting[: whole + (1 if left else 0)])


class SpindleMotion:
    """The spindle in motion in a loop with a fixed sample period: `contracts.Motion`."""

    __slots__ = ("_constants", "_tau", "_waiting", "dead_time", "speed")

    def __init__(self, model: Model, T: float):
        self.speed = float(model.initial_state[0])
        self._constants = coefficients(model.params, T)
        self._tau, self.dead_time = model.params["tau"], float(model.params["delay"])
        whole, _ = split_delay(model.params["delay"], T)
        self._waiting = deque([0.0] * (whole + 2), maxlen=whole + 2)  # oldest first: before, now, ...

    def read(self) -> float:
        """Speed, rev/min."""
        return self.speed

    def write(self, voltage: float) -> None:
        """Move on by one sample of constant `voltage`, V."""
        self._waiting.append(voltage)
        self.speed = sampled(self.speed, self._waiting[0], self._waiting[1], *self._constants)

    def move(self, voltage: float, time: float) -> None:
        """Move on by `time` s of constant `voltage`, V, which acts without the spindle's own delay."""
        K, offset, _, _ = self._constants
        self.speed = sampled(self.speed, 0.0, voltage, K, offset, 1.0, exp(-time / self._tau))


def make(**params: Any) -> Model:
    """The spindle at rest with the given `tau` (s) and `K` ((rev/min)/V), and, if not 0, `offset` (V) and `delay` (s).

    Raises InputError for an unknown, missing or impossible parameter.
    """
    values = read_all(params, PARAMETERS, "spindle", _NEUTRAL)
    return Model(advance, (0.0,), values, source=Source("spindle"), motion=SpindleMotion)
