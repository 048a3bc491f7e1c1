"""The machine's own axis as a model in a sampled loop: friction of every kind, play, dead zone, offset, delay; exact.

The parameters are those of an `[axis.NAME.machine]` table, the equations those of `rds.models.machine_axis`. The
delay need not be a whole number of samples: a voltage that is handed out at k T acts from k T + delay on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import floor
from typing import Any

from rds.core.errors import InputError
from rds.core.types import Model, Source
from rds.models import machine_axis
from rds.models.machine_axis import MachineParameters
from rds.models.machine_motion import moved, pull_of

NAME = "machine-axis"
PARAMETERS = machine_axis.PARAMETERS
_ROUNDING = 1e-9  # of a sample: a delay that is so near to whole samples is whole


def linear_part(params: Mapping[str, Any]) -> dict[str, float]:
    """τ and K of the axis without Coulomb friction, play and delay: what controllers are designed for.

    Viscous friction b is part of it: τ/(1 + b) and K/(1 + b), with the mean of both directions.
    """
    damping = 1.0 + params["viscous"] + 0.5 * params.get("viscous_difference", 0.0)
    return {"tau": params["tau"] / damping, "K": params["K"] / damping}


def split_delay(delay: float, T: float) -> tuple[int, float]:
    """A delay (s) as whole samples of `T` s, and what is left of it, s."""
    whole = floor(delay / T + _ROUNDING)
    left = delay - whole * T
    return whole, left if left > _ROUNDING * T else 0.0


def coefficients(params: Mapping[str, Any], T: float) -> tuple[float, ...]:
    """What `sampled` needs after its first five arguments, for samples of `T` s."""
    p = MachineParameters(**params)
    _, left = split_delay(p.delay, T)
    return (T, left, p.K, p.offset, p.dead_zone, *p.motion())


def sampled(
    carriage,
    velocity,
    position,
    before,
    now,
    T,
    left,
    K,
    offset,
    dead_zone,
    tau,
    damping,
    plus,
    minus,
    s,
    slow,
    half,
    back,
):
    """Carriage, velocity and position after one sample: the voltage `before` acts for `left` s, `now` for the rest."""
    if left > 0.0:
        pull = pull_of(before, K, offset, dead_zone)
        position, velocity, carriage = moved(
            position, velocity, carriage, pull, left, tau, damping, plus, minus, s, slow, half, back
        )
    pull = pull_of(now, K, offset, dead_zone)
    position, velocity, carriage = moved(
        position, velocity, carriage, pull, T - left, tau, damping, plus, minus, s, slow, half, back
    )
    return carriage, velocity, position


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float, ...]:
    """The exact response over `T` s: state and constant voltage `u` V in, state out.

    The state is carriage (mm, what the encoder sees), velocity (mm/s), position of the motor (mm), and, with a
    delay, the voltages that still wait, latest first; those that are not there are 0 V.
    """
    whole, left = split_delay(params["delay"], T)
    waiting = (u, *x[3:])
    now = waiting[whole] if whole < len(waiting) else 0.0
    before = waiting[whole + 1] if whole + 1 < len(waiting) else 0.0
    state = sampled(x[0], x[1], x[2], before, now, *coefficients(params, T))
    return (*state, *waiting[: whole + (1 if left else 0)])


class MachineAxisMotion:
    """The axis in motion in a loop with a fixed sample period: `contracts.Motion`."""

    __slots__ = ("_constants", "_state", "_waiting", "dead_time")

    def __init__(self, model: Model, T: float):
        carriage, velocity, position = model.initial_state[:3]
        self._state = float(carriage), float(velocity), float(position)
        self._constants = coefficients(model.params, T)
        self.dead_time = float(model.params["delay"])
        whole, _ = split_delay(model.params["delay"], T)
        self._waiting = deque([0.0] * (whole + 2), maxlen=whole + 2)  # oldest first: before, now, ...

    def read(self) -> float:
        """Position behind the play, mm."""
        return self._state[0]

    @property
    def velocity(self) -> float:
        """Velocity of the motor's side, before the play, mm/s."""
        return self._state[1]

    def write(self, voltage: float) -> None:
        """Move on by one sample of constant `voltage`, V."""
        self._waiting.append(voltage)
        self._state = sampled(*self._state, self._waiting[0], self._waiting[1], *self._constants)

    def move(self, voltage: float, time: float) -> None:
        """Move on by `time` s of constant `voltage`, V, which acts without the model's own delay."""
        self._state = sampled(*self._state, 0.0, voltage, time, 0.0, *self._constants[2:])


def make(**params: Any) -> Model:
    """The axis with the given parameters, at rest in the middle of its play; `tau` (s) and `K` ((mm/s)/V) are needed.

    Raises InputError for an unknown, missing or impossible parameter.
    """
    try:
        known = MachineParameters.from_table(params)
    except InputError as error:
        raise InputError(f"{NAME}: {error}") from None
    source, start = Source(NAME), (0.0, 0.0, 0.0)
    return Model(advance, start, asdict(known), source=source, motion=MachineAxisMotion, has_velocity=True)
