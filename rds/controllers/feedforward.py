"""The general tracking controller with friction and backlash compensated along the reference.

    u = (τ/K) (a_r + v_r/τ + g₁ (x_r - y) + g₂ (v_r - v̂)) + u_F + u_B

u_F = F±/K by the direction in which the reference moves: compensation by a friction model
(Armstrong-Hélouvry, Dupont, Canudas de Wit, "A survey of models, analysis tools and compensation methods for
the control of machines with friction", Automatica 30 (1994) 1083-1138). A reference that has stopped keeps
the compensation of its last direction; one that has not moved yet has none. u_B crosses the play after a
reversal: a right inverse of the backlash (Tao, Kokotović, "Adaptive Control of Systems with Actuator and
Sensor Nonlinearities", Wiley 1996), here smoothed: the shift s of the motor goes to ± backlash/2 with the
time constant `backlash_time`, and u_B = Δs/(K T), so that K ∑ u_B T is the play, exactly.

The observer is that of the tracking controller. It is fed u - u_F - u_B after saturation, because it knows an axis
without friction and play; with F± as they are, steady motion leaves no error.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import expm1
from typing import Any

from rds.controllers import tracking
from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import Declaration, Quantity
from rds.core.types import SPINDLE_UNIT, Controller, Reference, Source

NAME = "feedforward"
SPINDLE = False
COMPENSATION = {
    "friction_plus": Quantity("Coulomb friction while moving forward", "mm/s", low=0.0),
    "friction_minus": Quantity("Coulomb friction while moving backward", "mm/s", high=0.0),
    "backlash": Quantity("play between motor and encoder, its whole width", "mm", low=0.0),
    "backlash_time": Quantity("time constant of crossing the play", "s", above=0.0),
}
OPTIONS: Mapping[str, Declaration] = {**tracking.OF_POSITION, **COMPENSATION}
BACKLASH_TIME = 0.005  # s; chosen: half of the mini CNC's τ
TUNABLE = tracking.TUNABLE | COMPENSATION


def law(position, velocity, acceleration, y, state, c):
    """Voltage (V) and next state, for a reference (mm, mm/s, mm/s²) and the measured position `y` (mm).

    State: the observer's z (mm/s), 0.0 before the first sample and 1.0 after it, the direction of the reference
    (-1.0, 1.0, or 0.0 before it has moved), and the shift of the motor in its play (mm).
    """
    z, started, direction, shift = state
    inverse_gain, inertia, g1, g2, L, F, G, H, limit, plus, minus, half_play, share, T, weight = c
    if started == 0.0:
        z = -L * y  # the axis starts at rest, wherever it stands
    if velocity > 0.0:
        if direction == 0.0:
            shift = -half_play  # an axis may have been left on either side of its play; the far one is crossed
        direction = 1.0
    elif velocity < 0.0:
        if direction == 0.0:
            shift = half_play
        direction = -1.0
    moved = share * (direction * half_play - shift)
    known = inverse_gain * moved / T
    if direction > 0.0:
        known += plus
    elif direction < 0.0:
        known += minus
    pull = weight * acceleration + g1 * (position - y) + g2 * (velocity - (L * y + z))
    u = inertia * pull + inverse_gain * velocity + known
    if u > limit:
        u = limit
    elif u < -limit:
        u = -limit
    return u, (F * z + G * y + H * (u - known), 1.0, direction, shift + moved)


def control(t: float, r: Reference, y: float, state: Any, params: Mapping[str, Any]) -> tuple[float, Any]:
    """The fixed interface over `law`."""
    return law(r[0], r[1], r[2], y, state, params["coefficients"])


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """The tracking controller with compensation of one position axis; see `rds.controllers.library_controller`.

    Options: those of `tracking`, and `COMPENSATION`. Friction defaults to that of the axis's model where it has one,
    else to 0; backlash to 0. Raises InputError as `tracking` does.
    """
    owner = f"controller {NAME!r}"
    check_known(options, OPTIONS, owner)
    if unit == SPINDLE_UNIT:
        raise InputError(
            f"{owner} drives position axes: a spindle (unit {unit!r}) has no play to cross and its speed is measured; "
            f"use 'tracking', 'p', 'pid' or 'modified-pid'"
        )
    design = {name: value for name, value in options.items() if name in tracking.OF_POSITION}
    base = tracking.make(axis_model, T, converter_range, unit=unit, **design)
    friction = {name: axis_model.get(name, 0.0) for name in ("friction_plus", "friction_minus")}
    given = friction | {"backlash": 0.0, "backlash_time": BACKLASH_TIME} | options
    values = {name: declared.check(given[name], name, owner) for name, declared in COMPENSATION.items()}
    inverse_gain = base.params["coefficients"][0]
    coefficients = (
        *base.params["coefficients"],
        inverse_gain * values["friction_plus"],
        inverse_gain * values["friction_minus"],
        0.5 * values["backlash"],
        -expm1(-T / values["backlash_time"]),
        T,
        1.0,  # of the reference's acceleration; zero_phase.py has another one
    )
    params = {**base.params, **values, "coefficients": coefficients}
    retune = partial(_retuned, dict(axis_model), T, converter_range, base.params["observer_pole"])
    return Controller(control, (0.0, 0.0, 0.0, 0.0), params, Source(NAME), tunable=TUNABLE, retune=retune)


def _retuned(
    axis_model: Mapping[str, Any], T: float, converter_range: float, pole: float, values: Mapping[str, float]
) -> Mapping[str, Any]:
    """The parameters after they were changed while it runs. The observer stays: its state is made for its pole."""
    compensation: dict[str, Any] = {name: values[name] for name in COMPENSATION}
    gains = [values["g1"], values["g2"]]
    return make(axis_model, T, converter_range, gains=gains, observer_pole=pole, **compensation).params
