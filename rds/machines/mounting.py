"""Modules in an order from the tool to the work, as `[[link]]` tables; and motion chosen for axes that are not known.

Each module is mounted on the next one. A bed in the middle carries both sides, the tool's before it and the work's
behind it, whose axes count against the frame as those of tables do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any, TypeVar

from rds.core.toml_table import TomlTable
from rds.machines.library import LibraryModule
from rds.machines.machine import MACHINE, Axis, machine_from

SPEED = 600.0  # mm/min or degrees/min, of an axis of which nothing else is known
_RESERVE = 1.25  # of the model's speed at full voltage, over the axis's
_TAU, _SPINDLE_TAU = 0.02, 0.1  # s
_RAMP, _ROUND = 0.1, 0.05  # s: to full speed, to full acceleration
Each = TypeVar("Each")


def mounted(
    order: Sequence[Each], module: Callable[[Each], LibraryModule | None], table: Callable[[Each], dict[str, Any]]
) -> dict[str, Any]:
    """The keys `link`, and where a bed carries both sides `tool` and `work`, of the modules' machine.

    `module` is what is known of one, `table` its link without parent and sign; a link without name is called by its
    module.
    """
    links: list[dict[str, Any]] = []

    def mount(each: Each, **on: Any) -> None:
        made = table(each)
        count = 1 + sum(link.get("module") == made.get("module") for link in links)
        name = made.get("name") or (made["module"] if count == 1 else f"{made['module']}-{count}")
        sign = {"sign": on.pop("sign")} if "sign" in on and "axis" in made else {}
        on.pop("sign", None)
        links.append({"name": name, **made, **on, **sign})

    fork = next((place for place, each in enumerate(order) if _is_bed(module(each))), None)
    if fork is None:
        for each in reversed(order):
            mount(each)
        return {"link": links}
    bed = module(order[fork])
    assert bed is not None
    sides = [*bed.interfaces]
    links.append({**table(order[fork]), "name": "base"})
    for number, each in enumerate(reversed(order[:fork])):
        mount(each, **({"parent": "base", "parent_interface": sides[1]} if number == 0 else {}))
    ends: dict[str, Any] = {"tool": {"link": links[-1]["name"]}}
    for number, each in enumerate(order[fork + 1 :]):
        mount(each, sign=-1, **({"parent": "base", "parent_interface": sides[2]} if number == 0 else {}))
    if fork + 1 < len(order):
        ends |= {"work": {"link": links[-1]["name"]}}
    return {"link": links, **ends}


def with_zero(machine: dict[str, Any]) -> dict[str, Any]:
    """The machine's tables with the work's zero where the tip stands with all axes at zero, if the work has a link."""
    if "work" not in machine:
        return machine
    tip = machine_from(TomlTable(machine, MACHINE)).kinematics.forward({})[:3, 3]
    return machine | {"work": machine["work"] | {"offset": [round(float(value), 9) + 0.0 for value in tip]}}


def _is_bed(module: LibraryModule | None) -> bool:
    return module is not None and module.kind == "frame" and len(module.interfaces) > 2


def chosen_motion(speed: float, full: float) -> dict[str, Any]:
    """Model and limits of an axis that does `speed` (mm/min or degrees/min), with a reserve at `full` V."""
    per_second = speed / 60.0
    return {
        "model": {"name": "linear-axis", "tau": _TAU, "K": _RESERVE * per_second / full},
        "limits": {"velocity": per_second, "acceleration": per_second / _RAMP, "jerk": per_second / _RAMP / _ROUND},
    }


def chosen_spindle(speed: float, full: float) -> dict[str, Any]:
    """The model of a spindle that does `speed` (rev/min) at `full` V."""
    return {"model": {"name": "spindle", "tau": _SPINDLE_TAU, "K": speed / full}}


def axis_table(axis: Axis) -> dict[str, Any]:
    """The `[axis.NAME]` table of an axis that is known, but for its place in cyclic commands."""
    table = {key: value for key, value in asdict(axis).items() if key not in ("name", "slot") and value}
    return table | {"travel": list(axis.travel)}
