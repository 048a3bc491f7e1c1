"""The linear axis whose friction differs by direction in both its parts, solved exactly.

    τ v̇ + (1 + b±) v = K u - F±        b₊, F₊ while v > 0, b₋, F₋ while v < 0

An axis at rest stays at rest while F₋ <= K u <= F₊. Within a direction it is the linear axis with τ, K and F over
1 + b: so a sample needs at most one crossing and no solver. τ and K are those that controllers are designed for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import expm1, log1p
from typing import Any

from rds.core.options import read_all
from rds.core.quantities import Quantity
from rds.core.types import Model, Source

NAME = "directional-axis"
PARAMETERS = {
    "tau": Quantity("time constant", "s", above=0.0),
    "K": Quantity("gain", "(mm/s)/V"),
    "friction_plus": Quantity("Coulomb friction while moving forward", "mm/s", low=0.0),
    "friction_minus": Quantity("Coulomb friction while moving backward, against the motion", "mm/s", high=0.0),
    "viscous_plus": Quantity("speed lost to viscous friction while moving forward", "mm/s per mm/s", above=-1.0),
    "viscous_minus": Quantity("speed lost to viscous friction while moving backward", "mm/s per mm/s", above=-1.0),
}
_NEUTRAL = dict.fromkeys(("friction_plus", "friction_minus", "viscous_plus", "viscous_minus"), 0.0)


def respond(x, v, u, T, tau, K, plus, minus, viscous_plus, viscous_minus):
    """Position and velocity after `T` seconds of constant voltage `u`. Only arithmetic on floats."""
    drive = K * u
    left = T
    for _ in range(2):  # at most one crossing
        if v > 0.0 or (v == 0.0 and drive > plus):
            damping, final = 1.0 + viscous_plus, drive - plus
        elif v < 0.0 or drive < minus:
            damping, final = 1.0 + viscous_minus, drive - minus
        else:
            break
        time, final = tau / damping, final / damping
        stop = time * log1p(-v / final) if final * v < 0.0 else left
        crosses = stop < left
        part = stop if crosses else left
        gained = -expm1(-part / time)
        x += final * part + (v - final) * time * gained
        if not crosses:
            return x, v + (final - v) * gained
        v, left = 0.0, left - part
    return x, 0.0


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float, float]:
    """The exact response over `T` s: state (position mm, velocity mm/s) and constant voltage `u` V in, state out."""
    return respond(x[0], x[1], u, T, *(params[name] for name in PARAMETERS))


def make(**params: Any) -> Model:
    """The axis with the given `tau`, `K`, friction and viscous friction of each direction (0 if not given), at rest.

    Raises InputError for an unknown, missing or impossible parameter.
    """
    values = read_all(params, PARAMETERS, NAME, _NEUTRAL)
    return Model(advance, (0.0, 0.0), values, source=Source(NAME), has_velocity=True)
