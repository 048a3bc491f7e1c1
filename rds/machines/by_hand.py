"""A machine put together of modules of the library, without a bus that could say what is there.

The modules are named from the tool to the work. What no module of the library says is chosen, so that the machine can
be run at once in every mode: node numbers, the model, and limits of planned motion that its speed allows.
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
from rds.machines.mounting import SPEED, chosen_motion, mounted, with_zero
from rds.machines.ncc import axis_name

_TRAVEL = (-100.0, 100.0)
_FULL = 10.0  # V
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

    def link(each: str) -> dict[str, Any]:
        module = library_module(each)
        if not module.joint:
            return {"module": each}
        axis = axis_name(module.joint, axes)
        axes[axis] = _axis(module, len(axes) + 2)
        return {"module": each, "axis": axis}

    if not names:
        raise InputError("no module is named; begin with a cutting head")
    ends = mounted(names, library_module, link)
    if not axes:
        raise InputError("no module has a joint: nothing would move; take a linear or a rotary one")
    made = {"name": name, "title": f"Put together of {len(names)} modules", "sample_period": 0.001}
    made |= {"axis": dict(sorted(axes.items(), key=lambda each: _ORDER.index(each[0][0])))}
    return with_zero(made | ends)


def _axis(module: LibraryModule, node: int) -> dict[str, Any]:
    return {
        "node": node,
        "unit": "deg" if module.joint in ROTARY else "mm",
        "travel": list(module.travel or _TRAVEL),
        "resolution": module.resolution or 0.001,
    } | chosen_motion(module.speed or SPEED, _FULL)
