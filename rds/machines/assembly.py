"""A machine assembled of modules that say what they are: its file, and the verdict on it before there is one.

OACS thesis, 8.4: after a scan of the bus the user numbers the modules from the tool head to the workspace. Accessories,
beds, columns and tables have no board, and so no number: they stand in the order by their name in the library.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from itertools import chain
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.core.toml_text import toml_text
from rds.machines.configuration import Check, Verdict, verdict
from rds.machines.library import LibraryModule, by_type_text, library_module, told_module
from rds.machines.link_modules import said_by_link
from rds.machines.link_table import path_to
from rds.machines.machine import MACHINE, Axis, Machine, load_machine, machine_from, machine_names
from rds.machines.module_table import CARRIES_ON, MOUNTED_BY
from rds.machines.mounting import SPEED, chosen_motion, chosen_spindle, mounted, with_zero

Data = Mapping[str, Any]  # of one module, as `Information.as_dict`
Order = Sequence[int | str]  # from the tool to the work: numbers of modules, names of accessories in the library
_MODULE = (  # what a module tells, under the names of `[axis.NAME.module]`
    *("type_text", "accuracy", "repeatability", "counts_per_unit", "initial", "least_speed"),
    *("clockwise_speed", "counterclockwise_speed", "supply", "joint", "kind", "matrix", "accessory"),
)
_JOINTS = {"x": "X", "y": "Y", "z": "Z", "a": "XA", "b": "YA", "c": "ZA"}
_ABOUT = (
    "A machine configured from what its modules say, from the tool to the work: {order}.\n"
    "No module knows its axis's model and limits of planned motion: {known}."
)


def first_order(data: Mapping[int, Data]) -> list[int | str]:
    """The modules by number: tools first, then what fits on what as far as modules and library say, else by number.

    An accessory that a module says is mounted on it stands before that module, by its name in the library.
    """
    left = sorted(data, key=lambda number: (data[number]["kind"] != "tool", number))
    order: list[int | str] = []
    above: LibraryModule | None = None
    while left:
        fitting = (number for number in left if above is not None and _carries(data[number], above))
        number = next(fitting, left[0])
        if accessory := _accessory(data[number]):
            order.append(accessory.name)
        order.append(number)
        left.remove(number)
        above = _module(data[number])
    return order


def order_of(machine: Machine, data: Mapping[int, Data]) -> list[int | str] | None:
    """The order that a machine's links say, of these modules; None if one of them is none of the machine's."""
    links = {link.name: link for link in machine.links}
    to_tool, to_work = (path_to(links, end.link) if end else [] for end in (machine.tool, machine.work))
    carrying = [name for name in to_tool if name in to_work]
    names = [name for name in reversed(to_tool) if name not in carrying[:-1]]
    order: list[int | str] = []
    for name in [*names, *(name for name in to_work if name not in carrying)]:
        axis = machine.axes.get(links[name].axis or name)
        if axis is not None:
            order += [axis.node] if axis.node in data else []
        elif links[name].module:
            order.append(links[name].module)
    return order if set(data) <= set(order) else None


def _module(data: Data) -> LibraryModule | None:
    return told_module(data, by_type_text(data["type_text"]))


def _accessory(data: Data) -> LibraryModule | None:
    return by_type_text(data.get("accessory") or "")


def _carries(data: Data, above: LibraryModule) -> bool:
    module = _accessory(data) or _module(data)
    return module is not None and module.interface("", last=True).fits(above.interface("", last=False))


def judged(order: Order, data: Mapping[int, Data], name: str = "machine") -> Verdict:
    """The verdict on modules in this order."""
    if wrong := _before(order, data):
        return Verdict(name, tuple(Check("order", False, text) for text in wrong))
    return verdict(assembled(name, order, data))


def assembled(name: str, order: Order, data: Mapping[int, Data]) -> Machine:
    """The machine of these modules, not yet in a file. InputError with the first fault where they make none."""
    if wrong := _before(order, data):
        raise InputError(f"these modules make no machine in this order: {wrong[0]}")
    return machine_from(TomlTable(_table(name, order, data), MACHINE))


def machine_text(name: str, order: Order, data: Mapping[int, Data], before: Machine | None = None) -> str:
    """The machine's file, as TOML; InputError with the first fault of the order.

    What no module knows is taken from `before`, the machine that was reconfigured: its converter and supply, and model,
    limits, power, currents and physics of the axes whose module is of the same number and type; else from a machine of
    the package that has a module of this type; else it is chosen, within the speeds that the module says.
    """
    found = judged(order, data, name)
    if not found.ok:
        raise InputError(f"these modules make no machine in this order: {found.faults[0].text}")
    told = ", ".join(each if isinstance(each, str) else f"{_letter(data[each])} (module {each})" for each in order)
    table = _table(name, order, data)
    if before is not None:
        table["sample_period"] = before.sample_period
        table["converter"] = asdict(before.converter)
        if before.power is not None:
            table["power"] = asdict(before.power)
    known, machines = [], _with_such_modules(table["axis"].values())
    for letter, axis in table["axis"].items():
        kept, source = _kept(axis, before, machines)
        axis.update(kept or _chosen(axis, table["converter"]["range"]))
        known.append(f"those of {letter} are {f'from {source}' if kept else 'chosen'}")
    return toml_text(table, _ABOUT.format(order=told, known=", ".join(known)))


def _with_such_modules(axes: Iterable[Mapping[str, Any]]) -> list[Machine]:
    """The machines of the package, those with the most modules of these types first."""
    said = {axis["module"]["type_text"] for axis in axes}
    packaged = [load_machine(name) for name in machine_names()]
    return sorted(packaged, key=lambda machine: -len(said & {_type_text(machine, a) for a in machine.axes.values()}))


def _type_text(machine: Machine, axis: Axis) -> str:
    return str(axis.module.get("type_text") or said_by_link(machine, axis).get("type_text", ""))


def _kept(axis: Mapping[str, Any], before: Machine | None, packaged: Sequence[Machine]) -> tuple[dict[str, Any], str]:
    """Model, limits, power, currents and physics of an axis with such a module, and the machine that it is of."""
    for machine in chain([] if before is None else [before], packaged):
        for known in machine.axes.values():
            same = machine is not before or known.node == axis["node"]
            if same and _type_text(machine, known) == axis["module"]["type_text"]:
                tables = {"model": known.model, "machine": known.machine}
                limits = {"limits": asdict(known.limits)} if known.limits is not None else {}
                power = {"power": known.power} if known.power is not None else {}
                made = {key: dict(value) for key, value in tables.items() if value} | limits | power
                if made:
                    currents = {key: value for key, value in known.module.items() if "current_" in key}
                    return made | {"module": {**axis["module"], **currents}}, machine.name
    return {}, ""


def _chosen(axis: Mapping[str, Any], full: float) -> dict[str, Any]:
    told = axis["module"]
    speed = min(told["clockwise_speed"], told["counterclockwise_speed"]) or SPEED
    return chosen_spindle(speed, full) if told["kind"] == "tool" else chosen_motion(speed, full)


def _before(order: Order, data: Mapping[int, Data]) -> list[str]:
    """Why no machine can be made of these modules at all; empty where one can."""
    numbers = [each for each in order if isinstance(each, int)]
    if not numbers:
        return ["there are no modules that describe themselves: scan a bus whose modules speak oacs"]
    if unknown := [number for number in numbers if number not in data]:
        return [f"module {unknown[0]} is not on the bus; those that described themselves: {', '.join(map(str, data))}"]
    if twice := sorted({number for number in numbers if numbers.count(number) > 1}):
        return [f"module {twice[0]} stands twice in the order; name each once"]
    tools = [number for number in numbers if data[number]["kind"] == "tool"]
    axes = [number for number in numbers if data[number]["kind"] != "tool"]
    found = []
    if len(tools) != 1:
        found.append(f"there must be one tool; there are {len(tools)}")
    elif order[0] != tools[0]:
        found.append(f"the tool (module {tools[0]}) must be the first: numbering goes from the tool to the work")
    if not axes:
        found.append("there must be one axis at least")
    letters = [_letter(data[number]) for number in numbers]
    found += [
        f"{letters.count(letter)} modules are called {letter}; each needs a letter of its own"
        for letter in sorted({each for each in letters if letters.count(each) > 1})
    ]
    found += [
        f"module {number} says that {data[number]['accessory']!r} is mounted on it, which the library does not have"
        for number in numbers
        if data[number].get("accessory") and _accessory(data[number]) is None
    ]
    fixed = [number for number in axes if not data[number]["joint"]]
    return found + [f"module {number} does not say what it moves (its joint is empty)" for number in fixed]


def _table(name: str, order: Order, data: Mapping[int, Data]) -> dict[str, Any]:
    axes = {_letter(data[number]): _axis(number, data[number]) for number in order if isinstance(number, int)}
    table = {"name": name, "title": f"Configured from {len(order)} modules", "sample_period": 0.001}
    table |= {"converter": {"range": max(axis["module"]["supply"] for axis in axes.values())}, "axis": axes}
    return with_zero(table | mounted(order, lambda each: _known(each, data), lambda each: _link(each, data)))


def _known(each: int | str, data: Mapping[int, Data]) -> LibraryModule | None:
    return library_module(each) if isinstance(each, str) else _module(data[each])


def _link(each: int | str, data: Mapping[int, Data]) -> dict[str, Any]:
    if isinstance(each, str):
        return {"module": library_module(each).name}
    told = data[each]
    known = by_type_text(told["type_text"])
    table: dict[str, Any] = {"name": _letter(told)} | ({"module": known.name} if known else {})
    if told["kind"] != "tool":
        table |= {"axis": _letter(told), "joint": _JOINTS[told["joint"]]}
    return table | {"matrix": [list(row) for row in told["matrix"]]}


def _axis(number: int, data: Data) -> dict[str, Any]:
    table = {key: data[key] for key in _MODULE if data.get(key, "") != ""}
    for side in (MOUNTED_BY, CARRIES_ON):
        if said := data.get(side):
            table[side] = {key: value for key, value in said.items() if key != "name"}
    return {
        "node": number,
        "unit": {"°": "deg"}.get(data["unit"], data["unit"]),
        "travel": [data["lowest"], data["highest"]],
        "resolution": 1.0 / data["counts_per_unit"],
        "module": table | {"matrix": [list(row) for row in data["matrix"]]},
    } | ({"slot": data["slot"]} if data.get("slot") else {})


def _letter(data: Data) -> str:
    return str(data["axis"])
