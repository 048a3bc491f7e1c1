"""What the links of a machine's file say of its axes' modules: which of the library they are, and how they stand."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rds.machines.kinematics.build import resolved
from rds.machines.kinematics.transform import transformation
from rds.machines.library import library_module
from rds.machines.link_table import Link
from rds.machines.machine import Axis, Machine
from rds.machines.module_table import CARRIES_ON, MOUNTED_BY

_JOINTS = {"X": "x", "Y": "y", "Z": "z", "XA": "a", "YA": "b", "ZA": "c"}


def link_of(machine: Machine, axis: Axis) -> Link | None:
    """The link that an axis moves, or that is called as a spindle is."""
    return next((link for link in machine.links if (link.axis or link.name) == axis.name), None)


def said_by_link(machine: Machine, axis: Axis) -> dict[str, Any]:
    """Keys of `[axis.NAME.module]` that follow from the axis's link; none where it names no module of the library."""
    link = link_of(machine, axis)
    if link is None or not link.module:
        return {}
    module, full = library_module(link.module, link.place), resolved(link)
    matrix = full.matrix or transformation([*(full.angles or (0.0,) * 3), *(full.offset or (0.0,) * 3)]).tolist()
    sides = [*module.interfaces.values()]
    made = {"matrix": tuple(tuple(map(float, row)) for row in matrix), MOUNTED_BY: _side(sides[0])}
    made |= {CARRIES_ON: _side(sides[-1])} if len(sides) > 1 else {}
    made |= {"type_text": module.type_text} if module.type_text else {}
    return made | ({"joint": _JOINTS[full.joint]} if full.joint else {})


def _side(side: Any) -> dict[str, Any]:
    return {key: value for key, value in asdict(side).items() if key != "name"}
