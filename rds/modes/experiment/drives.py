"""Axes whose drives close loops of their own (CiA 402: csp, csv, pp): their models, laws and what they cannot follow.

| mode | what the loop hands out | what closes the loops | default model |
| --- | --- | --- | --- |
| cst | a voltage, as torque | the controller | the axis's own |
| csv | a velocity | controller (position) and drive (velocity) | `linear-axis` with a gain of 1 |
| csp | the reference's position | the drive; the controller gives way | `position-drive` |
| pp | the reference's position, when it changes | the drive, along a profile of its own | `profile-drive` |

The same holds in every mode of an experiment: a simulation has the drive's loops as its plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import numpy as np

from rds.bus.modules import dialects
from rds.core.errors import InputError
from rds.core.types import Controller, Model, Reference, Source
from rds.machines import Axis, Machine
from rds.models import library_model
from rds.models.position_drive import LOOP
from rds.modes.loop.commands import Command
from rds.modes.loop.laws import ReferenceSamples

_ROUNDING = 1.0 + 1e-6


def commands_of(bus: dict[str, Any], machine: Machine, axes: Sequence[str]) -> dict[str, Command]:
    """How each axis is commanded over this bus. InputError for a table that will not do."""
    told = dialects.commands(bus.get("dialect", dialects.DEFAULT), machine, axes, bus)
    return {name: Command[kind.upper()] for name, kind in told.items()}


def gives_way(axis: Axis, command: Command) -> bool:
    """Whether the drive alone closes the loop of what is measured, so that the controller has nothing to do."""
    return command in (Command.POSITION, Command.PROFILE) or (command is Command.VELOCITY and axis.is_spindle)


def top_speed(axis: Axis, machine: Machine) -> float:
    """What the axis reaches at the converter's full voltage, unit/s (rev/min); infinite where its model has no gain."""
    gain = axis.model.get("K")
    if gain is not None:
        return abs(float(gain)) * machine.converter.range
    return inf if axis.limits is None else axis.limits.velocity


def drive_model(axis: Axis, command: Command) -> Model:
    """What a well-tuned drive makes of its targets. InputError where a profile has no limits to keep to."""
    if command is Command.POSITION:
        return library_model("position-drive")
    if command is Command.PROFILE:
        if axis.limits is None:
            table = f"[axis.{axis.name}.limits]"
            raise InputError(f'mode = "pp" needs {table} in the machine\'s file; add it, or choose mode = "csp"')
        limits = axis.limits
        return library_model("profile-drive", speed=limits.velocity, acceleration=limits.acceleration)
    tau = LOOP["tau"].default
    return library_model("spindle" if axis.is_spindle else "linear-axis", tau=tau, K=1.0)


def giving_way(axis: Axis, command: Command, given: Controller | None) -> tuple[Controller, str]:
    """The law that hands the reference to the drive, and the sentence that says so in the result."""
    stands_back = "" if given is None else f"; the controller {given.source.name} gives way to it and does not run"
    said = f"axis {axis.name}: the drive's own {command.loop} follows the reference{stands_back}"
    return Controller(_reference, source=Source(f"the drive's {command.loop}")), said


def _reference(t: float, r: Reference, y: float, state: Any, params: Any) -> tuple[float, Any]:
    return r.position, state


def check_reference(reference: ReferenceSamples, axis: Axis, command: Command, most: float, T: float) -> None:
    """InputError for a reference that the drive cannot be led along: a jump in csp, anything else in pp."""
    position = reference.position
    if command is Command.PROFILE and (reference.velocity != 0.0).any():
        raise InputError(
            f'mode = "pp" moves axis {axis.name} by the drive\'s own profile to positions that stand (constant, '
            'square, staircase); this reference moves by itself: use mode = "csp"'
        )
    if command is not Command.POSITION:
        return
    steps = np.abs(np.diff(position, prepend=0.0))
    at = int(steps.argmax())
    if steps[at] > most * T * _ROUNDING:
        raise InputError(
            f"the reference of axis {axis.name} jumps by {steps[at]:g} {axis.unit} at t = {at * T:g} s, from where the "
            f"axis {'stands' if at == 0 else 'is led'}; in mode csp it may move by {most * T:g} {axis.unit} in a "
            f'sample ({most:g} {axis.unit}/s): use a smooth reference that begins at 0, or mode = "pp"'
        )
