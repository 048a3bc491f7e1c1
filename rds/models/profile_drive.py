"""An axis that its own drive moves to target positions by a trapezoidal profile (CiA 402, mode pp).

A new target starts a new profile from where the demand is; the drive's position and velocity loops follow the demand as
in `position_drive`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, copysign, sqrt
from typing import Any

from rds.core.errors import InputError
from rds.core.options import read_options
from rds.core.quantities import Quantity
from rds.core.types import Model, Source
from rds.models.position_drive import LOOP, settle

TICK = 0.25e-3  # s, at most, between two steps of the profile
PARAMETERS = LOOP | {
    "speed": Quantity("profile velocity", "mm/s", above=0.0),
    "acceleration": Quantity("profile acceleration", "mm/s²", above=0.0),
    "deceleration": Quantity("profile deceleration; by default the acceleration", "mm/s²", above=0.0),
}


def towards(value: float, target: float, most: float) -> float:
    """`value`, moved towards `target` by `most` at most."""
    return target if abs(target - value) <= most else value + copysign(most, target - value)


def profile_step(
    position: float,
    velocity: float,
    target: float,
    speed: float,
    acceleration: float,
    deceleration: float,
    T: float,
    halted: bool = False,
) -> tuple[float, float, bool]:
    """Position and velocity demand after `T` seconds, and whether it is at the target now.

    Never faster than can still be braked before the target; `halted` brakes to standstill wherever that is.
    """
    distance = target - position
    half = 0.5 * deceleration * T
    brakeable = sqrt(half * half + 2.0 * deceleration * abs(distance)) - half
    wanted = 0.0 if halted else copysign(min(speed, brakeable), distance)
    slowing = abs(wanted) < abs(velocity) or wanted * velocity < 0.0
    new = towards(velocity, wanted, (deceleration if slowing else acceleration) * T)
    moved = 0.5 * (velocity + new) * T
    if not halted and abs(distance) <= abs(moved) + 1e-9 and abs(new) <= 2.0 * deceleration * T:
        return target, 0.0, True
    return position + moved, new, False


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float, ...]:
    """The response over `T` s: state (position, velocity, demand, its velocity) and target `u` in, state out."""
    position, velocity, demand, slope = x
    steps = ceil(T / TICK - 1e-9)
    h = T / steps
    for _ in range(steps):
        before = demand
        demand, slope, _ = profile_step(
            demand, slope, u, params["speed"], params["acceleration"], params["deceleration"], h
        )
        mean = (demand - before) / h
        e, rate = settle(position - before, velocity - mean, h, params["position_gain"], params["tau"])
        position, velocity = demand + e, mean + rate
    return position, velocity, demand, slope


def make(**params: Any) -> Model:
    """An axis moved by profiles of `speed` (mm/s) and `acceleration` (mm/s²); see `PARAMETERS` for the others.

    Raises InputError for an unknown, missing or impossible parameter.
    """
    given = read_options(params, PARAMETERS, "profile-drive")
    for name in ("speed", "acceleration"):
        if name not in given:
            raise InputError(f"profile-drive needs {name} ({PARAMETERS[name].described})")
    values = {name: each.default for name, each in LOOP.items()} | {"deceleration": given["acceleration"]} | given
    return Model(advance, (0.0, 0.0, 0.0, 0.0), values, source=Source("profile-drive"), has_velocity=True)
