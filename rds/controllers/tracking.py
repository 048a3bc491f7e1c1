"""The general tracking controller with reduced-order observer (mini-cnc-rds, equations 4 to 9).

    u = (τ/K) (a_r + v_r/τ + g₁ (x_r - y) + g₂ (v_r - v̂))

with v̂ from the observer of `rds.controllers.observer`, which is fed the voltage after saturation: what the
axis really gets. Friction is not in the law. In steady motion it leaves an error of (F_C/τ)(1 + g₂/|pole|)/g₁.
A spindle, whose speed is measured, has the same law with one state and no observer: `rds.controllers.speed_tracking`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from rds.controllers import observer, speed_tracking
from rds.controllers.axis_data import AxisData, axis_data
from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import AnyValue, Declaration, Items, Quantity
from rds.core.types import SPINDLE_UNIT, Controller, Reference, Source

NAME = "tracking"
_REAL = Quantity("real pole", "1/s")
_PAIR = Items("pole", Quantity("real or imaginary part", "1/s"), "[real, imaginary]", 2)
OF_POSITION: Mapping[str, Declaration] = {
    "poles": Items("closed-loop poles, 1/s", AnyValue("pole", (_REAL, _PAIR)), "two poles", 2),
    "observer_pole": observer.POLE,
    "gains": Items("in place of poles", Quantity("gain"), "[g1, g2], in 1/s² and 1/s", 2),
}
OF_SPEED: Mapping[str, Declaration] = {"speed_pole": speed_tracking.POLE}
OPTIONS: Mapping[str, Declaration] = {**OF_POSITION, **OF_SPEED}
POLES = ((-32.0, 24.0), (-32.0, -24.0))  # 1/s: the paper's, settling in 0.125 s
OBSERVER_POLE = -320.0  # 1/s: the paper's
TUNABLE = {"g1": Quantity("position gain", "1/s²"), "g2": Quantity("velocity gain", "1/s")}


def law(position, velocity, acceleration, y, state, c):
    """Voltage (V) and next state, for a reference (mm, mm/s, mm/s²) and the measured position `y` (mm).

    State: the observer's z (mm/s), and 0.0 before the first sample, 1.0 after it.
    """
    z, started = state
    inverse_gain, inertia, g1, g2, L, F, G, H, limit = c
    if started == 0.0:
        z = -L * y  # the axis starts at rest, wherever it stands
    u = inertia * (acceleration + g1 * (position - y) + g2 * (velocity - (L * y + z))) + inverse_gain * velocity
    if u > limit:
        u = limit
    elif u < -limit:
        u = -limit
    return u, (F * z + G * y + H * u, 1.0)


def control(t: float, r: Reference, y: float, state: Any, params: Mapping[str, Any]) -> tuple[float, Any]:
    """The fixed interface over `law`."""
    return law(r[0], r[1], r[2], y, state, params["coefficients"])


def known(y, state, following, c):
    """The velocity (mm/s) that the observer saw at measured position `y`, `state` being the one before the voltage."""
    z, started = state
    if started == 0.0:
        return (0.0,)
    return (c[4] * y + z,)


def observe(y: float, state: Any, following: Any, params: Mapping[str, Any]) -> tuple[float]:
    """The signals as `known` gives them."""
    return (params["L"] * y + state[0] if state[1] else 0.0,)


def make(
    axis_model: Mapping[str, Any], T: float, converter_range: float, *, unit: str = "mm", **options: Any
) -> Controller:
    """The tracking controller of one axis; see `rds.controllers.library_controller`.

    Options of a position axis: `poles`, two closed-loop poles as [real, imaginary] or complex numbers, 1/s (default:
    the paper's -32 ± 24i); or `gains` = [g1, g2] (1/s², 1/s), already computed; `observer_pole`, 1/s (default -320).
    Of a spindle: `speed_pole`, 1/s (default -32). Raises InputError for an option of the other kind of axis, and for
    poles too fast for the sample period; gains that are handed in are taken as they are.
    """
    owner = f"controller {NAME!r}"
    check_known(options, OPTIONS, owner)
    if unit == SPINDLE_UNIT:
        _refuse(options, OF_POSITION, f"{owner}: a spindle has its speed measured and nothing to observe", "speed_pole")
        return speed_tracking.make(
            axis_model, T, converter_range, NAME, options.get("speed_pole", speed_tracking.SPEED_POLE)
        )
    _refuse(options, OF_SPEED, f"{owner}: this axis has its position controlled", "poles")
    axis = axis_data(axis_model, T, converter_range, unit, owner)
    pole = observer.check_pole(options.get("observer_pole", OBSERVER_POLE), owner)
    g1, g2 = _gains(options, axis.tau, owner)
    if "gains" not in options:
        _check_sampled(axis, g1, g2, owner)
    L, F, G, H = observer.coefficients(axis.tau, axis.K, pole, axis.T)
    readable = {"g1": g1, "g2": g2, "L": L, "F": F, "G": G, "H": H, "observer_pole": pole}
    coefficients = (1.0 / axis.K, axis.tau / axis.K, g1, g2, L, F, G, H, axis.converter_range)
    params = readable | {"coefficients": coefficients}
    retune = partial(_retuned, dict(axis_model), T, converter_range, pole)
    signals = {"velocity": f"{unit}/s"}
    return Controller(
        control, (0.0, 0.0), params, Source(NAME), tunable=TUNABLE, retune=retune, signals=signals, observe=observe
    )


def _retuned(
    axis_model: Mapping[str, Any], T: float, converter_range: float, pole: float, values: Mapping[str, float]
) -> Mapping[str, Any]:
    """The parameters after the gains were changed while it runs. The observer stays: its state is made for its pole."""
    gains = [values["g1"], values["g2"]]
    return make(axis_model, T, converter_range, gains=gains, observer_pole=pole).params


def is_sampled_stable(tau: Any, K: Any, T: float, g1: Any, g2: Any) -> Any:
    """Whether the loop sampled every `T` s is stable with these gains (Jury's criterion); arrays answer as arrays.

    The observer of the held axis separates: the loop's poles are its own F and those of the state feedback.
    """
    a12, a22, b1, b2 = observer.held_axis(tau, K, T)
    kx, kv = tau / K * g1, tau / K * g2
    trace = 1.0 - b1 * kx + a22 - b2 * kv
    determinant = (1.0 - b1 * kx) * (a22 - b2 * kv) + b2 * kx * (a12 - b1 * kv)
    return (abs(determinant) < 1.0) & (abs(trace) < 1.0 + determinant)


def is_stable_on_a_bus(coefficients: Sequence[float], T: float) -> bool:
    """Whether the loop sampled every `T` s is stable where a voltage acts one sample later, as on any bus.

    `coefficients` are those of `law`, whose observer is told the voltage at once.
    """
    inverse_gain, inertia, g1, g2, L, F, G, H, *_ = coefficients
    a12, a22, b1, b2 = observer.held_axis(inertia / inverse_gain, 1.0 / inverse_gain, T)
    voltage = -inertia * np.array([g1 + g2 * L, 0.0, g2, 0.0])  # of position, velocity, z, and the voltage before
    step = np.array([[1.0, a12, 0.0, b1], [0.0, a22, 0.0, b2], [G, 0.0, F, 0.0] + H * voltage, voltage])
    return bool(abs(np.linalg.eigvals(step)).max() < 1.0)


def _check_sampled(axis: AxisData, g1: float, g2: float, owner: str) -> None:
    """InputError if poles that are stable in continuous time make the sampled loop unstable."""
    if not is_sampled_stable(axis.tau, axis.K, axis.T, g1, g2):
        raise InputError(
            f"{owner}: with T = {axis.T:g} s these poles make the sampled loop unstable; "
            f"choose slower poles or a shorter sample period"
        )


def _refuse(options: Mapping[str, Any], others: Mapping[str, Declaration], why: str, instead: str) -> None:
    """InputError for an option of the other kind of axis."""
    for name in options:
        if name in others:
            raise InputError(f"{why}; remove {name}, or give {instead}")


def _gains(options: Mapping[str, Any], tau: float, owner: str) -> tuple[float, float]:
    if "gains" not in options:
        # On demand: python-control takes seconds to import, and whoever brings finished gains does without it.
        from rds.controllers.design import tracking_gains

        return tracking_gains(tau, options.get("poles", POLES))
    if "poles" in options:
        raise InputError(f"{owner}: gains and poles both say what the gains are; give one of them")
    gains = options["gains"]
    if not isinstance(gains, list | tuple) or len(gains) != 2:
        raise InputError(f"{owner}: gains = {gains!r} must be [g1, g2], in 1/s² and 1/s")
    return (
        TUNABLE["g1"].check(gains[0], "gains[0]", owner),
        TUNABLE["g2"].check(gains[1], "gains[1]", owner),
    )
