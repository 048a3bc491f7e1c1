"""Proportional control: u = bias + Pgain (r - y), held within the output limit."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from rds.controllers.axis_data import axis_data
from rds.controllers.pid_options import BIAS, GAINS, OUTPUT_LIMIT, output_limit, retuned
from rds.controllers.tuning import proportional_gain
from rds.core.options import read_options
from rds.core.types import Controller, Reference, Source

NAME = "p"
OPTIONS = {"Pgain": GAINS["Pgain"]} | BIAS | OUTPUT_LIMIT


def law(position, velocity, acceleration, y, state, c):
    """Voltage (V) and next state, for a reference (mm, mm/s, mm/s²) and the measured position `y` (mm)."""
    P, bias, limit = c
    u = bias + P * (position - y)
    if u > limit:
        u = limit
    elif u < -limit:
        u = -limit
    return u, state


def control(t: float, r: Reference, y: float, state: Any, params: Mapping[str, Any]) -> tuple[float, Any]:
    """The fixed interface over `law`."""
    return law(r[0], r[1], r[2], y, state, params["coefficients"])


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """P control of one axis; see `rds.controllers.library_controller`.

    Options: Pgain (default: `tuning.proportional_gain`), bias, maxoutput (0 = the converter's range). Its state
    is (0.0,), which it never changes. A spindle under P alone keeps a steady error of 1/(1 + K Pgain).
    """
    owner = f"controller {NAME!r}"
    given = read_options(options, OPTIONS, owner)
    axis = axis_data(axis_model, T, converter_range, unit, owner)
    gains = {"Pgain": proportional_gain(axis), "bias": 0.0, "maxoutput": 0.0} | given
    coefficients = (gains["Pgain"], gains["bias"], output_limit(gains["maxoutput"], axis.converter_range))
    retune = partial(retuned, make, dict(axis_model), T, converter_range, unit)
    params = gains | {"coefficients": coefficients}
    return Controller(control, (0.0,), params, Source(NAME), tunable=OPTIONS, retune=retune)
