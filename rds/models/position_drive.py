"""An axis under the position loop of its own drive, led by cyclic positions (CiA 402, mode csp).

    v_demand = ḋ + k (d - x)        the position loop, with the demand's slope fed forward
    τ v̇ + v = v_demand              what the velocity loop makes of it

Over one sample the demand d runs straight from the target before to the new one. There x = d solves both equations, so
that the deviation e = x - d obeys τ ë + ė + k e = 0 within the sample, and the response is closed-form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, exp, expm1, sin, sqrt
from typing import Any

from rds.core.options import read_options
from rds.core.quantities import Quantity
from rds.core.types import Model, Source

LOOP = {
    "position_gain": Quantity("gain of the position loop", "1/s", above=0.0, default=100.0),
    "tau": Quantity("time constant of the velocity loop", "s", above=0.0, default=1.0 / 600.0),
}
PARAMETERS = LOOP


def settle(e: float, rate: float, T: float, gain: float, tau: float) -> tuple[float, float]:
    """Deviation and its rate after `T` seconds of τ ë + ė + gain e = 0."""
    half = 0.5 / tau
    square = half * half - gain / tau
    root = sqrt(abs(square))
    if root * T < 1e-9:  # both poles at -1/(2τ)
        even, odd, decay = 1.0, T, exp(-half * T)
    elif square > 0.0:  # poles far apart: the slow one leads, and the other's part may be nothing
        gone = -expm1(-2.0 * root * T)
        even, odd, decay = 1.0 - 0.5 * gone, 0.5 * gone / root, exp(-(gain / tau) / (half + root) * T)
    else:
        even, odd, decay = cos(root * T), sin(root * T) / root, exp(-half * T)
    return (
        decay * (e * even + (rate + half * e) * odd),
        decay * (rate * even - (gain / tau * e + half * rate) * odd),
    )


def advance(x: Sequence[float], u: float, T: float, params: Mapping[str, Any]) -> tuple[float, float, float]:
    """The exact response over `T` s: state (position, velocity, target before) and new target `u` in, state out."""
    position, velocity, before = x
    slope = (u - before) / T
    e, rate = settle(position - before, velocity - slope, T, params["position_gain"], params["tau"])
    return u + e, slope + rate, u


def make(**params: Any) -> Model:
    """An axis led by positions, with the drive's `position_gain` (1/s) and `tau` of its velocity loop (s).

    Raises InputError for an unknown or impossible parameter.
    """
    values = {name: each.default for name, each in PARAMETERS.items()} | read_options(
        params, PARAMETERS, "position-drive"
    )
    return Model(advance, (0.0, 0.0, 0.0), values, source=Source("position-drive"), has_velocity=True)
