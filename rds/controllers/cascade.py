"""The servo cascade: a position gain over PID speed control over a current limit (mrm-control, figure 7).

    speed demand     w_r = Kpp (x_r - y) + speed_feedforward v_r
    speed error      e_n = w_r - w
    current demand   i   = Kp e_n + Ki (T (e_n + e_{n-1})/2 + Int_prev) + Kd (e_n - e_{n-1})/T     (equation 17)
    voltage          u   = R i + w/K,   |i| <= current_limit,   |u| <= the converter's range

The sum in brackets is the next Int_prev. The last line is what a current amplifier does: it gives the voltage that
drives the current through the armature's resistance R against the back-EMF w/K. With speed_feedforward = 1 and Kpp = 0
this is a speed loop, which follows the reference's velocity. On a spindle the speed is measured and its reference is
the speed demand. The speed w of other axes is the difference of measured positions, filtered with `speed_filter`,
exactly for a difference that is constant within a sample.

Anti-windup holds Int while current or voltage is at its limit and the error pushes further out. Without it
(`antiwindup = 0`) the integral winds up (oacs-thesis, figure 51); the thesis's remedy is `integral_limit`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import exp
from typing import Any

from rds.controllers.axis_data import AxisData, axis_data
from rds.controllers.pid_options import OUTPUT_LIMIT, limit_or_none, output_limit, retuned
from rds.controllers.tuning import cascade_gains
from rds.core.errors import InputError
from rds.core.options import read_options
from rds.core.quantities import Quantity
from rds.core.types import Controller, Reference, Source

NAME = "cascade"
POSITION = {
    "Kpp": Quantity("position gain; 0 = speed control alone", "1/s", low=0.0),
    "speed_feedforward": Quantity("share of the reference's velocity that is speed demand", low=0.0),
}
SPEED = {
    "Kp": Quantity("proportional gain of the speed loop", "A/(mm/s)", low=0.0),
    "Ki": Quantity("integral gain of the speed loop", "A/mm", low=0.0),
    "Kd": Quantity("derivative gain of the speed loop", "A/(mm/s²)", low=0.0),
    "speed_filter": Quantity("time constant of the measured speed's filter; 0 = none", "s", low=0.0),
    "integral_limit": Quantity("limit of the speed error's integral; 0 = none", "mm", low=0.0),
    "antiwindup": Quantity("1: the integral is held at a limit; 0: it winds up", low=0, high=1, whole=True),
}
CURRENT = {
    "current_limit": Quantity("limit of the current demand; 0 = none", "A", low=0.0),
    "resistance": Quantity("resistance of the armature", "Ohm", above=0.0),
}
OPTIONS = POSITION | SPEED | CURRENT | OUTPUT_LIMIT
RESISTANCE = 1.0  # Ohm, chosen where the model knows none: amperes are then volts above the back-EMF


def law(position, velocity, acceleration, y, state, c):
    """Voltage (V) and next state, for a reference (mm, mm/s, mm/s²) and the measured position `y` (mm).

    State: integral of the speed error (mm), its last value (mm/s), the filtered speed (mm/s), the last `y` (mm), the
    speed demand (mm/s), the current demand (A), and 0.0 before the first sample, 1.0 after it.
    """
    integral, last, speed, before, _, _, started = state
    T, spindle, q, Kpp, share, Kp, Ki, Kd, most, held, most_current, R, emf, limit = c
    if spindle != 0.0:
        demand = position
        speed = q * speed + (1.0 - q) * y if started != 0.0 else y
    else:
        demand = Kpp * (position - y) + share * velocity
        speed = q * speed + (1.0 - q) * ((y - before) / T) if started != 0.0 else 0.0
    e = demand - speed
    if started == 0.0:
        last = e  # there is no slope before the second sample
    summed = integral + 0.5 * (e + last) * T
    if summed > most:
        summed = most
    elif summed < -most:
        summed = -most
    current = Kp * e + Ki * summed + Kd * (e - last) / T
    limited = 0.0
    if current > most_current:
        current = most_current
        limited = 1.0
    elif current < -most_current:
        current = -most_current
        limited = -1.0
    u = R * current + emf * speed
    if u > limit:
        u = limit
        limited = 1.0
    elif u < -limit:
        u = -limit
        limited = -1.0
    if held != 0.0 and e * limited > 0.0:
        summed = integral
    return u, (summed, e, speed, y, demand, current, 1.0)


def control(t: float, r: Reference, y: float, state: Any, params: Mapping[str, Any]) -> tuple[float, Any]:
    """The fixed interface over `law`."""
    return law(r[0], r[1], r[2], y, state, params["coefficients"])


def known(y, state, following, c):
    """Speed demand and measured speed (mm/s), the speed error's integral (mm), and the current demand (A)."""
    return following[4], following[2], following[0], following[5]


def observe(y: float, state: Any, following: Any, params: Mapping[str, Any]) -> tuple[float, float, float, float]:
    """The signals as `known` gives them."""
    return following[4], following[2], following[0], following[5]


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """The cascade of one axis; see `rds.controllers.library_controller` and `OPTIONS`.

    Defaults: gains of `tuning.cascade_gains`, the speed feedforward 1, anti-windup on, no limits; the resistance of
    a model that has one, else 1 Ohm. Raises InputError for an option of the position loop on a spindle.
    """
    owner = f"controller {NAME!r}"
    given = read_options(options, OPTIONS, owner)
    axis = axis_data(axis_model, T, converter_range, unit, owner)
    if axis.spindle and (wrong := [name for name in POSITION if given.get(name)]):
        raise InputError(
            f"{owner}: {wrong[0]} is of the position loop, and a spindle has its speed controlled; remove it"
        )
    resistance = axis_model.get("resistance", RESISTANCE) if "resistance" not in given else given["resistance"]
    neutral = dict.fromkeys(OPTIONS, 0.0) | {"antiwindup": 1, "resistance": resistance}
    values: dict[str, Any] = neutral | cascade_gains(axis, resistance, given.get("speed_filter")) | given
    params = values | {"coefficients": _coefficients(axis, values)}
    length, rate = (f"({unit})·s", unit) if axis.spindle else (unit, f"{unit}/s")
    signals = {"speed_demand": rate, "speed": rate, "integral": length, "current": "A"}
    retune = partial(retuned, make, dict(axis_model), T, converter_range, unit)
    tunable = {name: option for name, option in OPTIONS.items() if not (axis.spindle and name in POSITION)}
    start = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Controller(
        control, start, params, Source(NAME), tunable=tunable, retune=retune, signals=signals, observe=observe
    )


def _coefficients(axis: AxisData, values: Mapping[str, Any]) -> tuple[float, ...]:
    """What `law` takes as `c`."""
    time = values["speed_filter"]
    return (
        axis.T,
        float(axis.spindle),
        exp(-axis.T / time) if time > 0.0 else 0.0,
        *(values[name] for name in ("Kpp", "speed_feedforward", "Kp", "Ki", "Kd")),
        limit_or_none(values["integral_limit"]),
        float(values["antiwindup"]),
        limit_or_none(values["current_limit"]),
        values["resistance"],
        1.0 / axis.K,
        output_limit(values["maxoutput"], axis.converter_range),
    )
