"""The axis in mass form: what a drive's force moves, in kg and N.

    M v' + F_v v + F_c sign(v) + offset = g u                                (v in m/s, u the command)

With the option `per-direction` viscous and Coulomb friction are free for each direction, which takes up the offset:

    M v' + F_v± v ± F_c± = g u,      all of them positive

At rest the axis stays while the force is within Coulomb friction. The force gain g (N per unit of the command) is a
parameter that is given with the log, never estimated: data of commands and positions tell ratios to it only. It is 1
where the command is a force in N. The two forms are those of Janot, Gautier and Brunot (2019) for the EMPS. The output
is the position in mm, as everywhere, or the speed in mm/s where no position was logged.

`axis_inertia` is the same of what turns, by other names and units: so all that stands here goes by a `Form`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.identification.logs.log import RATES, Log
from rds.identification.structures import mass_kernel
from rds.identification.structures.signals import PER_SI, POSITIONS
from rds.identification.structures.structure import Structure

OUTPUTS = ("mm", "mm/s")
OPTIONS = ("per-direction",)
GAIN = "force_gain"
_Rates = tuple[float, float, float, float, float]


@dataclass(frozen=True)
class Form:
    """What a mass in kg, or an inertia in kg·m², calls its parameters: meaning and unit of each by the name here."""

    name: str
    own: Mapping[str, str]  # the name of each parameter of axis-mass
    force: str  # unit of forces: N or Nm
    damping: str  # unit of viscous friction
    mass: str
    moved: str  # in words: mass or inertia
    forces: str  # in words: force or torque

    def table(self, per_direction: bool, command: str) -> dict[str, Quantity]:
        """The parameters by their own names."""
        offset = f"{self.forces} that the drive holds against at rest (gravity, amplifier)"
        made = {"M": Quantity(f"moved {self.moved}", self.mass, above=0.0)}
        if per_direction:
            for kind, what, unit in (("F_v", "viscous", self.damping), ("F_c", "Coulomb", self.force)):
                for side, word in (("plus", "forward"), ("minus", "backward")):
                    made[f"{kind}_{side}"] = Quantity(f"{what} friction while moving {word}", unit, low=0.0)
        else:
            made["F_v"] = Quantity("viscous friction", self.damping, low=0.0)
            made["F_c"] = Quantity("Coulomb friction", self.force, low=0.0)
            made["offset"] = Quantity(offset, self.force)
        given = f"{self.forces} that the command makes; given, not estimated"
        made[GAIN] = Quantity(given, f"{self.force}/{command}" if command != self.force else "")
        return {self.own.get(name, name): quantity for name, quantity in made.items()}

    def plain(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values by the names of axis-mass."""
        theirs = {own: name for name, own in self.own.items()}
        return {theirs.get(name, name): value for name, value in values.items()}


LINEAR = Form("axis-mass", {}, "N", "N·s/m", "kg", "mass", "force")


def make(options: Sequence[str] = (), output: str = "mm", command: str = "V") -> Structure:
    """The structure `axis-mass`, with friction free per direction if `options` say so."""
    return made_of(LINEAR, options, output, command)


def made_of(form: Form, options: Sequence[str], output: str, command: str) -> Structure:
    """The structure of a form, for an output and a command in these units."""
    parameters = form.table("per-direction" in options, command)
    per_si, rate = PER_SI[output], output in RATES
    given = partial(force_gain, form, command)
    return Structure(
        name=form.name,
        parameters=parameters,
        units={name: quantity.unit for name, quantity in parameters.items()},
        states=1 if rate else 2,
        respond=partial(_respond, form, per_si, rate),
        options=tuple(options),
        sensitivities=partial(_sensitivities, form, per_si, rate),
        as_model=partial(_as_model, form, per_si * POSITIONS[output][1]),
        state_names=("velocity",) if rate else ("position", "velocity"),
        start=partial(_starts, form, tuple(options), output, command, given),
        given=given,
        default_method="inverse-dynamics",  # a free run drifts in closed loop
        output_unit=output,
        command_unit=command,
    )


def force_gain(form: Form, command: str, logs: Sequence[Log]) -> dict[str, float]:
    """The force gain (N or Nm per unit of the command) that the logs state; 1 for a command that is a force itself.

    InputError if a log does not state it, in the form's unit, or they differ.
    """
    name = form.own.get(GAIN, GAIN)
    if command == form.force:
        return {name: 1.0}
    for log in logs:
        if log.force_gain is None:
            raise InputError(
                f"{form.name} needs the {form.forces} that the command makes, and the log does not say; give "
                f"`{name} = ...` ({form.force}/{command}) in the map beside the data, or --fix {name}=...; without it, "
                f"{form.moved} and friction are known as ratios to it only: fit the structure axis",
                log.source or log.name,
            )
        if (has := log.units.get("force", "N")) != form.force:
            raise InputError(
                f"{form.name} needs the {form.forces} that the command makes in {form.force}/{command}, and the map "
                f"gives it in {has}/{command}; give `{name} = ...`, or choose the structure for it",
                log.source or log.name,
            )
    gains = {float(log.force_gain) for log in logs if log.force_gain is not None}
    if len(gains) > 1:
        raise InputError(
            f"the logs state different {form.forces} gains, {', '.join(f'{gain:g}' for gain in sorted(gains))} "
            f"{form.force}/{command}; fit those of one drive together"
        )
    return {name: gains.pop()}


def _of_kernel(form: Form, per_si: float, named: Mapping[str, float]) -> tuple[_Rates, np.ndarray]:
    """b, c₊, c₋, r₊, r₋ of the kernel, and their derivatives (5, parameters) in the order of the structure's."""
    values = form.plain(named)
    M = values["M"]
    names = list(form.plain(dict.fromkeys(form.table("F_c" not in values, "V"), 0.0)))
    at = {name: column for column, name in enumerate(names)}
    forces = np.zeros((5, len(names)))  # g, holding force forward and backward, viscous friction forward and backward
    forces[0, at[GAIN]] = per_si
    if "F_c" in values:
        forces[1, at["F_c"]] = forces[2, at["F_c"]] = per_si
        forces[1, at["offset"]], forces[2, at["offset"]] = per_si, -per_si
        forces[3, at["F_v"]] = forces[4, at["F_v"]] = 1.0
    else:
        forces[1, at["F_c_plus"]] = forces[2, at["F_c_minus"]] = per_si
        forces[3, at["F_v_plus"]] = forces[4, at["F_v_minus"]] = 1.0
    rates = forces @ np.array([values[name] for name in names]) / M
    slopes = forces / M
    slopes[:, at["M"]] -= rates / M
    b, plus, minus, r_plus, r_minus = rates.tolist()
    return (b, plus, minus, r_plus, r_minus), slopes


def _state(x0: Sequence[float], rate: bool) -> tuple[float, float]:
    return (0.0, float(x0[0])) if rate else (float(x0[0]), float(x0[1]))


def _respond(
    form: Form,
    per_si: float,
    rate: bool,
    t: np.ndarray,
    u: np.ndarray,
    x0: Sequence[float],
    values: Mapping[str, float],
) -> np.ndarray:
    """Outputs at the times `t`, from `x0` = position and velocity, or the velocity alone."""
    rates, _ = _of_kernel(form, per_si, values)
    return mass_kernel.positions(_floats(t), _floats(u), *_state(x0, rate), *rates, rate)


def _sensitivities(
    form: Form,
    per_si: float,
    rate: bool,
    t: np.ndarray,
    u: np.ndarray,
    x0: Sequence[float],
    values: Mapping[str, float],
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs (samples,) and their derivatives (samples, parameters + states): by the structure's, by the state."""
    rates, slopes = _of_kernel(form, per_si, values)
    y, by_rates = mass_kernel.sensitivities(_floats(t), _floats(u), *_state(x0, rate), *rates, rate)
    return y, np.hstack([by_rates[:, :5] @ slopes, by_rates[:, 6 if rate else 5 :]])


def _floats(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=float)


def _as_model(form: Form, per_si: float, values: Mapping[str, float]) -> dict[str, Any]:
    """The library's axis that moves the same: tau, K and friction in mm/s; InputError where there is none.

    With friction per direction, tau and K are those of the mean of both.
    """
    rates, _ = _of_kernel(form, per_si, values)
    b, plus, minus, r_plus, r_minus = rates
    symmetric = "F_c" in form.plain(values)
    if not (r_plus > 0.0 and r_minus > 0.0 and plus >= 0.0 and minus >= 0.0):
        own = {name: form.own.get(name, name) for name in ("F_v", "F_c", "F_v_plus", "F_v_minus")}
        needs = (
            f"{own['F_v']} > 0 and an offset smaller than {own['F_c']}"
            if symmetric
            else f"{own['F_v_plus']} and {own['F_v_minus']} greater than 0"
        )
        raise InputError(
            f"this {form.name} is no linear axis: that needs {needs}; it moves by itself, or without "
            "limit: fit `--structure axis`"
        )
    r = 0.5 * (r_plus + r_minus)
    table = {"name": "linear-axis", "tau": 1.0 / r, "K": b / r, "friction_plus": plus / r, "friction_minus": -minus / r}
    if symmetric:
        return table
    return table | {
        "name": "directional-axis",
        "viscous_plus": r_plus / r - 1.0,
        "viscous_minus": r_minus / r - 1.0,
    }


def _starts(
    form: Form,
    options: tuple[str, ...],
    output: str,
    command: str,
    given: Callable[[Sequence[Log]], Mapping[str, float]],
    logs: Sequence[Log],
) -> list[tuple[dict[str, float], list[tuple[float, ...]]]]:
    """Values to begin a fit with: what inverse dynamics makes of the logs."""
    from rds.identification.fit.inverse_dynamics import regress_logs

    # a search begins well enough with what a spline makes of gaps
    found = regress_logs(logs, made_of(form, options, output, command), {}, bridged=np.inf)
    values = {name: value if name == "offset" else max(value, 1e-9) for name, value in found.values.items()}
    states: list[tuple[float, ...]] = []
    for log in logs:
        few = slice(0, min(len(log), 20))
        begin = float(log.position[0])
        slope = float(np.polyfit(log.time[few] - log.time[0], log.position[few], 1)[0])
        states.append((begin,) if output in RATES else (begin, slope))
    return [(values | dict(given(logs)), states)]
