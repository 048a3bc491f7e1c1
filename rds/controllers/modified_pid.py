"""Modified PID control: proportional and derivative act on the measurement, with set-point weights b and c.

    u = bias + Pgain (b r - y) + Igain ∫(r - y) + Dgain d/dt (c r - y)_f

with r and y counted from where the axis stands at the first sample, so that it starts without a jump anywhere.
A step of the reference then reaches the axis through the integral, and only a share b of it through Pgain, so that
it overshoots less, and with c = 0 it gives no derivative kick. The price is a following error of
(1 - b) Pgain/Igain per mm/s of reference. Integral, derivative filter and anti-windup are discretized as in
`rds.controllers.pid`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import exp
from typing import Any

from rds.controllers.axis_data import axis_data
from rds.controllers.pid_options import (
    BIAS,
    ERROR_LIMITS,
    FILTER,
    GAINS,
    OUTPUT_LIMIT,
    integral_unit,
    limit_or_none,
    output_limit,
    retuned,
)
from rds.controllers.tuning import pid_gains, set_point_weight
from rds.core.options import read_options
from rds.core.quantities import Quantity
from rds.core.types import Controller, Reference, Source

NAME = "modified-pid"
WEIGHTS = {
    "b": Quantity("set-point weight of the proportional part", low=0.0),
    "c": Quantity("set-point weight of the derivative part", low=0.0),
}
OPTIONS = GAINS | WEIGHTS | BIAS | {"maxerrorI": ERROR_LIMITS["maxerrorI"]} | OUTPUT_LIMIT | FILTER


def law(position, velocity, acceleration, y, state, c):
    """Voltage (V) and next state, for a reference (mm, mm/s, mm/s²) and the measured position `y` (mm).

    State: integral of the error (mm s), filtered derivative of c r - y (mm/s), the last c r - y (mm), the `y` of the
    first sample (mm), and 0.0 before the first sample, 1.0 after it.
    """
    integral, derivative, last, origin, started = state
    T, q, slope, P, I, D, b, weight, bias, maxerrorI, limit = c  # noqa: E741
    if started == 0.0:
        origin = y
    e = position - y
    weighted = e - (1.0 - weight) * (position - origin)
    summed = integral + e * T
    if summed > maxerrorI:
        summed = maxerrorI
    elif summed < -maxerrorI:
        summed = -maxerrorI
    if started != 0.0:  # there is no slope before the second sample
        derivative = q * derivative + slope * (weighted - last)
    u = bias + P * (e - (1.0 - b) * (position - origin)) + I * summed + D * derivative
    if u > limit:
        u = limit
        if e > 0.0:
            summed = integral
    elif u < -limit:
        u = -limit
        if e < 0.0:
            summed = integral
    return u, (summed, derivative, weighted, origin, 1.0)


def control(t: float, r: Reference, y: float, state: Any, params: Mapping[str, Any]) -> tuple[float, Any]:
    """The fixed interface over `law`."""
    return law(r[0], r[1], r[2], y, state, params["coefficients"])


def known(y, state, following, c):
    """The integral of the error (mm s), this sample included."""
    return (following[0],)


def observe(y: float, state: Any, following: Any, params: Mapping[str, Any]) -> tuple[float]:
    """The signals as `known` gives them."""
    return (following[0],)


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """Modified PID control of one axis; see `rds.controllers.library_controller` and `OPTIONS`.

    Defaults: gains of `tuning.pid_gains`, b of `tuning.set_point_weight` (0.61 on a position axis), c = 0, no limits.
    """
    owner = f"controller {NAME!r}"
    given = read_options(options, OPTIONS, owner)
    axis = axis_data(axis_model, T, converter_range, unit, owner)
    gains = dict.fromkeys(OPTIONS, 0.0) | pid_gains(axis) | {"b": set_point_weight(axis)} | given
    q = exp(-axis.T / gains["derivative_filter"]) if gains["derivative_filter"] > 0.0 else 0.0
    coefficients = (
        axis.T,
        q,
        (1.0 - q) / axis.T,
        *(gains[name] for name in ("Pgain", "Igain", "Dgain", "b", "c", "bias")),
        limit_or_none(gains["maxerrorI"]),
        output_limit(gains["maxoutput"], axis.converter_range),
    )
    retune = partial(retuned, make, dict(axis_model), T, converter_range, unit)
    params = gains | {"coefficients": coefficients}
    start, signals = (0.0, 0.0, 0.0, 0.0, 0.0), {"integral": integral_unit(unit)}
    return Controller(
        control, start, params, Source(NAME), tunable=OPTIONS, retune=retune, signals=signals, observe=observe
    )
