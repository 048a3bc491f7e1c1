"""A fit: logs and a structure in, an estimate out, by one of the methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.registry import Registry
from rds.identification.fit.estimate import Estimate
from rds.identification.logs.log import Log, as_logs, named_apart
from rds.identification.structures import SIMULATION_ERROR
from rds.identification.structures.structure import Structure
from rds.identification.structures.structures import for_logs
from rds.identification.structures.structures import structure as make_structure

METHODS = Registry(  # each module has `estimate(logs, structure, options) -> Estimate`
    "method",
    {
        SIMULATION_ERROR: "rds.identification.fit.simulation_error",
        "inverse-dynamics": "rds.identification.fit.inverse_dynamics",
        "step": "rds.identification.fit.step_fit",
        "frequency": "rds.identification.fit.frequency",
    },
    own=False,
)
_OF_POSITIONS = ("step", "frequency")  # methods that take a speed of the structure spindle only


def fit(
    logs: Log | Sequence[Log],
    structure: Structure | str | Path,
    method: str | None = None,
    options: Mapping[str, Any] | None = None,
) -> Estimate:
    """The parameters of `structure` that explain the logs, all fitted together, by the method's own `options`.

    `structure` by its name or file where its own options and units are not needed (`rds.structure`). InputError for an
    unknown structure, method or option, no logs, or logs that hold nothing to estimate from.
    """
    logs = as_logs(logs)
    if not logs:
        raise InputError("there is no log to fit; name at least one")
    if not isinstance(options, Mapping | None):
        raise InputError(f"options = {options!r:.60} must be a dict, such as {{'fixed': {{'tau': 0.01}}}}")
    structure = make_structure(structure) if isinstance(structure, str | Path) else structure
    if not isinstance(structure, Structure):
        raise InputError(f"{structure!r:.60} is no structure; give its name, such as 'axis', or rds.structure(...)")
    named = named_apart(logs)
    structure = for_logs(structure, named)
    if method in _OF_POSITIONS and structure.is_rate and structure.name != "spindle":
        raise InputError(
            f"--method {method} of structure {structure.name} takes positions, and the log has a speed alone; take "
            "--method simulation or inverse-dynamics, or --structure spindle",
            named[0].source or named[0].name,
        )
    named, options = _with_gain(named, structure, dict(options or {}))
    if structure.prepare:
        output, command = structure.output_unit, structure.command_unit  # of the logs, whatever is prepared
        structure = replace(structure.prepare(named), output_unit=output, command_unit=command)
    estimated: Estimate = METHODS.module(method or structure.default_method).estimate(named, structure, options)
    if estimated.relative_error_percent is None:
        estimated = replace(estimated, relative_error_percent=voltage_error_percent(named, structure, estimated))
    return estimated


def _with_gain(logs: list[Log], structure: Structure, options: dict[str, Any]) -> tuple[list[Log], dict[str, Any]]:
    """A held force or torque gain is what the logs would state: theirs, where they state none."""
    fixed = dict(options.get("fixed") or {})
    for name, unit in (("force_gain", "N"), ("torque_gain", "Nm")):
        if name not in fixed or name not in structure.parameters or structure.command_unit == unit:
            continue
        if stated := [log for log in logs if log.force_gain is not None]:
            raise InputError(
                f"{name} is given with the log ({stated[0].force_gain:g} {structure.units[name]}) and cannot be held "
                "at another value; change it in the map beside the data, or leave --fix out",
                stated[0].source or stated[0].name,
            )
        value = structure.parameters[name].check(fixed.pop(name), name, f"structure {structure.name}")
        logs = [replace(log, force_gain=float(value), units={**log.units, "force": unit}) for log in logs]
    return logs, {**options, "fixed": fixed} if "fixed" in options else options


def voltage_error_percent(logs: Sequence[Log], structure: Structure, estimate: Estimate) -> float | None:
    """100 |the voltage that the model needs beside the one given| / |the one given|, over the motion of all logs.

    None where the logs hold too little motion to say.
    """
    from rds.identification.fit.needed_voltage import needed_voltage, smoothed_velocity
    from rds.identification.fit.residuals import bandwidth, block_length

    values, is_rate = estimate.values(), structure.is_rate
    extra = given = 0.0
    for log in logs:
        with np.errstate(all="ignore"):
            response = structure.respond(log.time, log.command, estimate.initial_state[log.name], values)
        if len(log) < 20 or not np.isfinite(response).all():
            return None
        rate = response if is_rate else np.diff(response) / np.diff(log.time)
        block = max(block_length(bandwidth(rate, log.sample_period), log.sample_period, len(log)), 4)
        velocity = smoothed_velocity(log, block, is_rate)
        found = needed_voltage(log, structure, values, velocity, block, is_rate)
        if found.relative_percent is None:
            return None
        extra = hypot(extra, float(np.linalg.norm(found.extra)))
        given = hypot(given, float(np.linalg.norm(found.command)))
    return 100.0 * extra / given
