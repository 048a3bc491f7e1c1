"""The axis in mass form: what a drive's force moves, in kg and N.

    M v' + F_v v + F_c sign(v) + offset = g u                                (v in m/s, u the command in V)

With the option `per-direction` viscous and Coulomb friction are free for each direction, which takes up the offset:

    M v' + F_v± v ± F_c± = g u,      all of them positive

At rest the axis stays while the force is within Coulomb friction. The force gain g (N/V) is a parameter that is given
with the log, never estimated: data of voltages and positions tell ratios to it only. The two forms are those of Janot,
Gautier and Brunot (2019) for the EMPS. The output is the position in mm, as everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.identification.logs.log import Log
from rds.identification.structures import mass_kernel
from rds.identification.structures.structure import Structure

OPTIONS = ("per-direction",)
_MM = 1000.0  # mm in a metre

_GAIN = {"force_gain": Quantity("force that the command makes; given, not estimated", "N/V")}
PLAIN = {
    "M": Quantity("moved mass", "kg", above=0.0),
    "F_v": Quantity("viscous friction", "N·s/m", low=0.0),
    "F_c": Quantity("Coulomb friction", "N", low=0.0),
    "offset": Quantity("force that the drive holds against at rest (gravity, amplifier)", "N"),
}
PER_DIRECTION = {
    "M": PLAIN["M"],
    "F_v_plus": Quantity("viscous friction while moving forward", "N·s/m", low=0.0),
    "F_v_minus": Quantity("viscous friction while moving backward", "N·s/m", low=0.0),
    "F_c_plus": Quantity("Coulomb friction while moving forward", "N", low=0.0),
    "F_c_minus": Quantity("Coulomb friction while moving backward", "N", low=0.0),
}
UNITS = {"M": "kg", "offset": "N", "force_gain": "N/V"}


def make(options: Sequence[str] = ()) -> Structure:
    """The structure `axis-mass`, with friction free per direction if `options` say so."""
    per_direction = "per-direction" in options
    parameters = {**(PER_DIRECTION if per_direction else PLAIN), **_GAIN}
    return Structure(
        name="axis-mass",
        parameters=parameters,
        units={name: UNITS.get(name, "N·s/m" if name.startswith("F_v") else "N") for name in parameters},
        states=2,
        respond=respond,
        options=tuple(options),
        sensitivities=sensitivities,
        as_model=as_model,
        start=_Start(tuple(options)),
        given=force_gain,
        default_method="inverse-dynamics",  # a free run drifts in closed loop
    )


def force_gain(logs: Sequence[Log]) -> dict[str, float]:
    """The force gain (N/V) that the logs state; InputError if one does not, or they differ."""
    for log in logs:
        if log.force_gain is None:
            raise InputError(
                "axis-mass needs the force that the command makes, and the log does not say; give `force_gain = ...` "
                "(N/V) in the map beside the data, or fit the structure axis, which needs none",
                log.source or log.name,
            )
    gains = {float(log.force_gain) for log in logs if log.force_gain is not None}
    if len(gains) > 1:
        raise InputError(
            f"the logs state different force gains, {', '.join(f'{gain:g}' for gain in sorted(gains))} N/V; "
            f"fit those of one drive together"
        )
    return {"force_gain": gains.pop()}


def _of_kernel(values: Mapping[str, float]) -> tuple[tuple[float, ...], np.ndarray]:
    """b, c₊, c₋, r₊, r₋ of the kernel, and their derivatives (5, parameters) in the order of the structure's."""
    M = values["M"]
    names = list({**(PLAIN if "F_c" in values else PER_DIRECTION), **_GAIN})
    at = {name: column for column, name in enumerate(names)}
    forces = np.zeros((5, len(names)))  # g, holding force forward and backward, viscous friction forward and backward
    forces[0, at["force_gain"]] = _MM
    if "F_c" in values:
        forces[1, at["F_c"]] = forces[2, at["F_c"]] = _MM
        forces[1, at["offset"]], forces[2, at["offset"]] = _MM, -_MM
        forces[3, at["F_v"]] = forces[4, at["F_v"]] = 1.0
    else:
        forces[1, at["F_c_plus"]] = forces[2, at["F_c_minus"]] = _MM
        forces[3, at["F_v_plus"]] = forces[4, at["F_v_minus"]] = 1.0
    rates = forces @ np.array([values[name] for name in names]) / M
    slopes = forces / M
    slopes[:, at["M"]] -= rates / M
    return tuple(rates.tolist()), slopes


def respond(t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
    """Positions in mm at the times `t`, from `x0` = position mm, velocity mm/s."""
    rates, _ = _of_kernel(values)
    return mass_kernel.positions(_floats(t), _floats(u), float(x0[0]), float(x0[1]), *rates)


def sensitivities(
    t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (samples,) and their derivatives (samples, parameters + 2): by the structure's, by the state."""
    rates, slopes = _of_kernel(values)
    y, by_rates = mass_kernel.sensitivities(_floats(t), _floats(u), float(x0[0]), float(x0[1]), *rates)
    return y, np.hstack([by_rates[:, :5] @ slopes, by_rates[:, 5:]])


def _floats(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=float)


def as_model(values: Mapping[str, float]) -> dict[str, Any]:
    """The library's axis that moves the same: tau, K and friction in mm/s; InputError where there is none.

    With friction per direction, tau and K are those of the mean of both.
    """
    rates, _ = _of_kernel(values)
    b, plus, minus, r_plus, r_minus = rates
    if not (r_plus > 0.0 and r_minus > 0.0 and plus >= 0.0 and minus >= 0.0):
        needs = "F_v > 0 and an offset smaller than F_c" if "F_c" in values else "F_v_plus and F_v_minus greater than 0"
        raise InputError(
            f"this axis-mass is no linear axis: that needs {needs}; it moves by itself, or without "
            "limit: fit `--structure axis`"
        )
    r = 0.5 * (r_plus + r_minus)
    table = {"name": "linear-axis", "tau": 1.0 / r, "K": b / r, "friction_plus": plus / r, "friction_minus": -minus / r}
    if "F_c" in values:
        return table
    return table | {
        "name": "directional-axis",
        "viscous_plus": r_plus / r - 1.0,
        "viscous_minus": r_minus / r - 1.0,
    }


class _Start:
    """Values to begin a fit with: what inverse dynamics makes of the logs."""

    def __init__(self, options: tuple[str, ...]):
        self.options = options

    def __call__(self, logs: Sequence[Log]) -> list[tuple[dict[str, float], list[tuple[float, ...]]]]:
        from rds.identification.fit.inverse_dynamics import regress_logs

        found = regress_logs(logs, make(self.options), {})
        values = {
            name: max(value, 1e-9) if name.startswith("F_") or name == "M" else value
            for name, value in found.values.items()
        }
        states: list[tuple[float, ...]] = []
        for log in logs:
            few = slice(0, min(len(log), 20))
            slope = np.polyfit(log.time[few] - log.time[0], log.position[few], 1)[0]
            states.append((float(log.position[0]), float(slope)))
        return [(values | force_gain(logs), states)]
