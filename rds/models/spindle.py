"""The spindle: a first-order speed loop, solved exactly.

    τ v̇ + v = K u        v in rev/min, u in V

Over a period T of constant voltage, v⁺ = K u + (v - K u) e^(-T/τ).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import exp
from typing import Any

from rds.core.errors import InputError
from rds.core.options import Option, read_options
from rds.core.types import Model, Source

PARAMETERS = {
    "tau": Option("time constant, s", more_than=0.0),
    "K": Option("gain, (rev/min)/V"),
}


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float]:
    """The exact response over `T` s: state (speed, rev/min) and constant voltage `u` V in, state out."""
    final = params["K"] * u
    return (final + (x[0] - final) * exp(-T / params["tau"]),)


class SpindleMotion:
    """The spindle in motion in a loop with a fixed sample period: `contracts.Motion`."""

    __slots__ = ("_K", "_decay", "speed")

    def __init__(self, model: Model, T: float):
        self.speed = float(model.initial_state[0])
        self._K = model.params["K"]
        self._decay = exp(-T / model.params["tau"])

    def read(self) -> float:
        """Speed, rev/min."""
        return self.speed

    def write(self, voltage: float) -> None:
        """Move on by one sample of constant `voltage`, V."""
        final = self._K * voltage
        self.speed = final + (self.speed - final) * self._decay


def make(**params: Any) -> Model:
    """The spindle with the given `tau` (s) and `K` ((rev/min)/V), at rest.

    Raises InputError for an unknown, missing or impossible parameter.
    """
    values = read_options(params, PARAMETERS, "spindle")
    for name, option in PARAMETERS.items():
        if name not in values:
            raise InputError(f"spindle needs {name} ({option.meaning})")
    return Model(advance, (0.0,), values, source=Source("spindle"), motion=SpindleMotion)
