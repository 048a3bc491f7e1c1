"""General tracking control of a spindle: `tracking` where the speed itself is measured.

    τ ω̇ + ω = K u,    e = ω_r - ω,    u = (τ/K) (ω̇_r + ω_r/τ + g₁ e)

The error then obeys ė = -(1/τ + g₁) e: equations 4 to 8 of mini-cnc-rds with one state instead of two. Nothing is left
to observe. Friction is not in the law: in steady motion it leaves an error of F_C/(τ |pole|).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import exp
from typing import Any

from rds.controllers.axis_data import AxisData, axis_data
from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.types import SPINDLE_UNIT, Controller, Reference, Source

POLE = Quantity("of a spindle: closed-loop pole of its speed, left of 0, such as -32", "1/s")
SPEED_POLE = -32.0  # 1/s: the speed settles in 0.125 s, as the paper's axes do
TUNABLE = {"g1": Quantity("speed gain", "1/s")}


def law(position, velocity, acceleration, y, state, c):
    """Voltage (V) and next state, for a speed and its slope (rev/min, rev/min/s) and the measured speed `y`."""
    inverse_gain, inertia, g1, limit = c
    u = inertia * (velocity + g1 * (position - y)) + inverse_gain * position
    if u > limit:
        u = limit
    elif u < -limit:
        u = -limit
    return u, state


def control(t: float, r: Reference, y: float, state: Any, params: Mapping[str, Any]) -> tuple[float, Any]:
    """The fixed interface over `law`."""
    return law(r[0], r[1], r[2], y, state, params["coefficients"])


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, name: str, pole: Any = SPEED_POLE
) -> Controller:
    """The law of a spindle with the closed-loop `pole` (1/s), called `name`.

    Raises InputError for a pole that is not stable, or too fast for the sample period.
    """
    owner = f"controller {name!r}"
    axis = axis_data(axis_model, T, converter_range, SPINDLE_UNIT, owner)
    wanted = POLE.check(pole, "speed_pole", owner)
    if wanted >= 0.0:
        raise InputError(f"{owner}: speed_pole = {pole!r} 1/s is not stable; it must be less than 0, such as -32")
    g1 = -wanted - 1.0 / axis.tau
    if not _is_sampled_stable(axis, g1):
        raise InputError(
            f"{owner}: with T = {axis.T:g} s this speed_pole makes the sampled loop unstable; "
            f"choose a slower pole or a shorter sample period"
        )
    retune = partial(_retuned, dict(axis_model), T, converter_range, name)
    params = _params(axis, g1)
    return Controller(control, (0.0,), params, Source(name), tunable=TUNABLE, retune=retune)


def _is_sampled_stable(axis: AxisData, g1: float) -> bool:
    """Whether the pole of the loop that holds its voltage for T is within the unit circle."""
    kept = exp(-axis.T / axis.tau)
    return abs(kept - (1.0 - kept) * axis.tau * g1) < 1.0


def _params(axis: AxisData, g1: float) -> dict[str, Any]:
    coefficients = (1.0 / axis.K, axis.tau / axis.K, g1, axis.converter_range)
    return {"g1": g1, "speed_pole": -g1 - 1.0 / axis.tau, "coefficients": coefficients}


def _retuned(
    axis_model: Mapping[str, Any], T: float, converter_range: float, name: str, values: Mapping[str, float]
) -> Mapping[str, Any]:
    """The parameters after the gain was changed while it runs; gains of one's own are taken as they are."""
    axis = axis_data(axis_model, T, converter_range, SPINDLE_UNIT, f"controller {name!r}")
    return _params(axis, values["g1"])
