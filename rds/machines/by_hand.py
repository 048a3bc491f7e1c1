"""A machine put together of modules of the library, without a bus that could say what is there.

The modules are named from the tool to the work. Each is mounted on the next one; a bed in the middle carries both
sides, the tool's before it and the work's behind it, whose axes count against the frame as those of tables do. What no
module of the library says is chosen, so that the machine can be run at once in every mode: node numbers, the
model, and limits of planned motion that its speed allows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.core.toml_text import toml_text
from rds.machines.configuration import Check, Verdict, verdict
from rds.machines.library import LibraryModule, library_module
from rds.machines.link_table import ROTARY
from rds.machines.machine import MACHINE, Machine, machine_from
from rds.machines.ncc import axis_name

_SPEED = 600.0  # mm/min or degrees/min, of a module that says none
_TRAVEL = (-100.0, 100.0)
_FULL = 10.0  # V
_RESERVE = 1.25  # of the model's speed at full voltage, over the module's
_TAU = 0.02  # s
_RAMP, _ROUND = 0.1, 0.05  # s: to full speed, to full acceleration
_ORDER = "XYZUVWABC"  # of axes in the file
_ABOUT = (
    "A machine put together by hand, from the tool to the work: {order}.\n"
    "Nodes, models, sample period and limits (within the modules' speeds) are chosen."
)


def machine_of_modules(names: Sequence[str], name: str = "machine") -> Machine:
    """The machine of these modules of the library, from the tool to the work, not yet in a file.

    InputError for a name that the library does not have, and where nothing would move.
    """
    return machine_from(TomlTable(_table(names, name), MACHINE))


def verdict_of_modules(names: Sequence[str], name: str = "machine") -> Verdict:
    """Whether these modules make a machine in this order."""
    try:
        return verdict(machine_of_modules(names, name))
    except InputError as error:
        return Verdict(name, (Check("chain", False, str(error)),))


def text_of_modules(names: Sequence[str], name: str) -> str:
    """The machine's file, as TOML. InputError with the first fault of what makes no machine."""
    found = verdict_of_modules(names, name)
    if not found.ok:
        raise InputError(f"these modules make no machine in this order: {found.faults[0].text}")
    return toml_text(_table(names, name), _ABOUT.format(order=", ".join(names)))


def _table(names: Sequence[str], name: str) -> dict[str, Any]:
    axes: dict[str, Any] = {}
    links: list[dict[str, Any]] = []
    taken: list[str] = []

    def mount(each: str, sign: int, **on: Any) -> None:
        module = library_module(each)
        taken.append(each)
        count = taken.count(each)
        table: dict[str, Any] = {"name": each if count == 1 else f"{each}-{count}", "module": each, **on}
        if module.joint:
            table["axis"] = axis_name(module.joint, axes)
            axes[table["axis"]] = _axis(module, len(axes) + 2)
            table |= {"sign": sign} if sign < 0 else {}
        links.append(table)

    if not names:
        raise InputError("no module is named; begin with a cutting head")
    fork = _fork(names)
    to_tool, to_work = (names, ()) if fork is None else (names[:fork], names[fork + 1 :])
    if fork is not None:
        sides = [*library_module(names[fork]).interfaces]
        links.append({"name": "base", "module": names[fork]})
    for number, each in enumerate(reversed(to_tool)):
        first = number == 0 and fork is not None
        mount(each, 1, **({"parent": "base", "parent_interface": sides[1]} if first else {}))
    ends: dict[str, Any] = {"tool": {"link": links[-1]["name"]}}
    for number, each in enumerate(to_work):
        mount(each, -1, **({"parent": "base", "parent_interface": sides[2]} if number == 0 else {}))
    if not axes:
        raise InputError("no module has a joint: nothing would move; take a linear or a rotary one")
    made = {"name": name, "title": f"Put together of {len(names)} modules", "sample_period": 0.001}
    made |= {"axis": dict(sorted(axes.items(), key=lambda each: _ORDER.index(each[0][0]))), "link": links}
    if not to_work:
        return made
    made |= ends | {"work": {"link": links[-1]["name"]}}
    tip = machine_from(TomlTable(made, MACHINE)).kinematics.forward({})[:3, 3]
    return made | {"work": {"link": links[-1]["name"], "offset": [round(float(value), 9) + 0.0 for value in tip]}}


def _fork(names: Sequence[str]) -> int | None:
    """Where the module stands that carries both the side of the tool and that of the work; None without one."""
    for place, name in enumerate(names):
        module = library_module(name)
        if module.kind == "frame" and len(module.interfaces) > 2:
            return place
    return None


def _axis(module: LibraryModule, node: int) -> dict[str, Any]:
    speed = (module.speed or _SPEED) / 60.0
    return {
        "node": node,
        "unit": "deg" if module.joint in ROTARY else "mm",
        "travel": list(module.travel or _TRAVEL),
        "resolution": module.resolution or 0.001,
        "model": {"name": "linear-axis", "tau": _TAU, "K": _RESERVE * speed / _FULL},
        "limits": {"velocity": speed, "acceleration": speed / _RAMP, "jerk": speed / _RAMP / _ROUND},
    }
