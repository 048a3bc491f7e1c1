"""PID control with feedforward, filtered derivative and anti-windup.

    u = bias + Pgain e + Igain ∫e + Dgain ė_f + FF0 x_r + FF1 v_r + FF2 a_r + FF3 ȧ_r,        e = r - y

Names and order of operations are those of LinuxCNC's pid component, so that gains carry over. Discretized so:
the error is limited by maxerror, then the deadband is taken off it; the integral is the sum of e T, this sample
included; the derivative passes through 1/(s derivative_filter + 1), exactly for an error that runs straight
between samples,

    ė_f⁺ = q ė_f + (1 - q) (e - e₋)/T,        q = e^(-T/derivative_filter)

(no filter: the plain difference). Feedforward uses the reference's own velocity and acceleration, limited by maxcmdD
and maxcmdDD, not differences; its jerk ȧ_r is the difference of the accelerations.
Anti-windup is by clamping: a sample whose voltage is at the limit and whose error pushes it further out does not
count in the integral.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import exp
from typing import Any

from rds.controllers.axis_data import axis_data
from rds.controllers.pid_options import (
    BIAS,
    COMMAND_LIMITS,
    DEADBAND,
    ERROR_LIMITS,
    FEEDFORWARD,
    FILTER,
    GAINS,
    OUTPUT_LIMIT,
    integral_unit,
    limit_or_none,
    output_limit,
    retuned,
)
from rds.controllers.tuning import pid_gains
from rds.core.options import read_options
from rds.core.types import Controller, Reference, Source

NAME = "pid"
OPTIONS = GAINS | BIAS | FEEDFORWARD | DEADBAND | ERROR_LIMITS | COMMAND_LIMITS | OUTPUT_LIMIT | FILTER


def law(position, velocity, acceleration, y, state, c):
    """Voltage (V) and next state, for a reference (mm, mm/s, mm/s²) and the measured position `y` (mm).

    State: integral of the error (mm s), its filtered derivative (mm/s), the last error (mm) and acceleration of the
    reference (mm/s²), and 0.0 before the first sample, 1.0 after it.
    """
    integral, derivative, last, accelerated, started = state
    T, q, slope, P, I, D, bias, FF0, FF1, FF2, FF3, deadband = c[:12]  # noqa: E741
    maxerror, maxerrorI, maxerrorD, maxcmdD, maxcmdDD, limit = c[12:]
    if velocity > maxcmdD:
        velocity = maxcmdD
    elif velocity < -maxcmdD:
        velocity = -maxcmdD
    if acceleration > maxcmdDD:
        acceleration = maxcmdDD
    elif acceleration < -maxcmdDD:
        acceleration = -maxcmdDD
    jerk = 0.0
    e = position - y
    if e > maxerror:
        e = maxerror
    elif e < -maxerror:
        e = -maxerror
    if e > deadband:
        e -= deadband
    elif e < -deadband:
        e += deadband
    else:
        e = 0.0
    summed = integral + e * T
    if summed > maxerrorI:
        summed = maxerrorI
    elif summed < -maxerrorI:
        summed = -maxerrorI
    if started != 0.0:  # there is no slope before the second sample
        jerk = (acceleration - accelerated) / T
        derivative = q * derivative + slope * (e - last)
        if derivative > maxerrorD:
            derivative = maxerrorD
        elif derivative < -maxerrorD:
            derivative = -maxerrorD
    u = bias + P * e + I * summed + D * derivative + FF0 * position + FF1 * velocity + FF2 * acceleration + FF3 * jerk
    if u > limit:
        u = limit
        if e > 0.0:
            summed = integral
    elif u < -limit:
        u = -limit
        if e < 0.0:
            summed = integral
    return u, (summed, derivative, e, acceleration, 1.0)


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
    """PID control of one axis; see `rds.controllers.library_controller` and `OPTIONS`.

    Defaults: gains of `tuning.pid_gains`; FF1 = 1/K and FF2 = τ/K on a position axis (the frictionless axis then
    follows without error), no feedforward on a spindle, whose reference usually steps; no limits, no deadband.
    """
    owner = f"controller {NAME!r}"
    given = read_options(options, OPTIONS, owner)
    axis = axis_data(axis_model, T, converter_range, unit, owner)
    gains = dict.fromkeys(OPTIONS, 0.0) | pid_gains(axis)
    if not axis.spindle:
        gains |= {"FF1": 1.0 / axis.K, "FF2": axis.tau / axis.K}
    gains |= given
    q = exp(-axis.T / gains["derivative_filter"]) if gains["derivative_filter"] > 0.0 else 0.0
    coefficients = (
        axis.T,
        q,
        (1.0 - q) / axis.T,
        *(gains[name] for name in ("Pgain", "Igain", "Dgain", "bias", "FF0", "FF1", "FF2", "FF3", "deadband")),
        *(limit_or_none(gains[name]) for name in (*ERROR_LIMITS, *COMMAND_LIMITS)),
        output_limit(gains["maxoutput"], axis.converter_range),
    )
    retune = partial(retuned, make, dict(axis_model), T, converter_range, unit)
    params = gains | {"coefficients": coefficients}
    start, signals = (0.0, 0.0, 0.0, 0.0, 0.0), {"integral": integral_unit(unit)}
    return Controller(
        control, start, params, Source(NAME), tunable=OPTIONS, retune=retune, signals=signals, observe=observe
    )
