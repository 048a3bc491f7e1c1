"""A machine configured from modules that describe themselves: their order from tool to work, and a machine file.

Oacs-thesis 8.4: modules are numbered from the tool head to the workspace; whether the structure is kinematically
viable follows from the modules' own transformation matrices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.toml_text import toml_text
from rds.machines import load_machine

Data = Mapping[str, Any]  # of one module, as `Information.as_dict`
_SINGULAR = 1e-6  # smallest singular value of directions that are told apart
_AXES = "xyz"
_MODULE = (  # what a module tells, under the names of `[axis.NAME.module]`
    *("type_text", "accuracy", "repeatability", "counts_per_unit", "initial", "least_speed"),
    *("clockwise_speed", "counterclockwise_speed", "supply", "joint", "kind", "matrix"),
)
_ABOUT = (
    "A machine configured from what its modules say, from the tool to the work: {order}.\n"
    "Yours to add, because no module knows it: [axis.NAME.model] (rds fit) and [axis.NAME.limits]."
)


def moved(order: Sequence[int], number: int, by: int) -> list[int]:
    """The order with one module moved towards the work (+1) or the tool (-1); at its end it stays."""
    place = order.index(number)
    target = min(max(place + by, 0), len(order) - 1)
    rest = [each for each in order if each != number]
    return [*rest[:target], number, *rest[target:]]


def first_order(data: Mapping[int, Data]) -> list[int]:
    """The modules by number, tools first."""
    return sorted(data, key=lambda number: (data[number]["kind"] != "tool", number))


def faults(order: Sequence[int], data: Mapping[int, Data]) -> list[str]:
    """Why these modules, in this order, make no machine; empty where they do."""
    if not order:
        return ["there are no modules that describe themselves: scan a bus whose modules speak oacs"]
    tools = [number for number in order if data[number]["kind"] == "tool"]
    axes = [number for number in order if data[number]["kind"] != "tool"]
    found = []
    if len(tools) != 1:
        found.append(f"there must be one tool; there are {len(tools)}")
    elif order[0] != tools[0]:
        found.append(f"the tool (module {tools[0]}) must be the first: numbering goes from the tool to the work")
    if not axes:
        found.append("there must be one axis at least")
    letters = [_letter(data[number]) for number in order]
    found += [
        f"{letters.count(letter)} modules are called {letter}; each needs a letter of its own"
        for letter in sorted({each for each in letters if letters.count(each) > 1})
    ]
    fixed = [number for number in axes if not data[number]["joint"]]
    found += [f"module {number} does not say what it moves (its joint is empty)" for number in fixed]
    return found + _dependent([n for n in order if n not in fixed], data)


def directions(order: Sequence[int], data: Mapping[int, Data]) -> dict[int, tuple[str, np.ndarray]]:
    """For each axis whether it shifts or turns, and along which direction, seen from the tool, all axes at zero.

    The product of the matrices before it brings an axis's own x, y or z into the tool's frame (unit vectors).
    """
    turned, found = np.eye(3), {}
    for number in order:
        joint = data[number]["joint"]
        if joint:
            along = "abc".find(joint) if joint in "abc" else _AXES.index(joint)
            found[number] = ("turns" if joint in "abc" else "shifts", turned[:, along].copy())
        turned = turned @ np.asarray(data[number]["matrix"], dtype=float)[:3, :3]
    return found


def _dependent(order: Sequence[int], data: Mapping[int, Data]) -> list[str]:
    """Axes that move nothing that those before them do not move already."""
    found, kept = [], {"shifts": np.empty((3, 0)), "turns": np.empty((3, 0))}
    for number, (kind, direction) in directions(order, data).items():
        more = np.column_stack([kept[kind], direction])
        if np.linalg.svd(more, compute_uv=False)[-1] < _SINGULAR or more.shape[1] > 3:
            found.append(
                f"module {number} ({_letter(data[number])}) {kind} the tool in a direction in which the modules before "
                "it do already: leave it out, or mount it in another direction"
            )
        else:
            kept[kind] = more
    return found


def machine_text(name: str, order: Sequence[int], data: Mapping[int, Data], sample_period: float = 0.001) -> str:
    """The machine's file, as TOML; InputError with the first fault of the order."""
    wrong = faults(order, data)
    if wrong:
        raise InputError(f"these modules make no machine in this order: {wrong[0]}")
    told = ", ".join(f"{_letter(data[number])} (module {number})" for number in order)
    axes = {_letter(data[number]): _axis(number, data[number]) for number in order}
    table = {"name": name, "title": f"Configured from {len(order)} modules", "sample_period": sample_period}
    return toml_text(table | {"axis": axes}, _ABOUT.format(order=told))


def write_machine(folder: Path, file: str, order: Sequence[int], data: Mapping[int, Data]) -> Path:
    """Write the machine's file into `folder`; InputError for a name that will not do, or a file that is there."""
    if Path(file).name != file or not file.endswith(".toml") or file.startswith("."):
        raise InputError(f"{file!r} must be a plain name that ends with .toml, as in my-machine.toml")
    path = folder / file
    if path.exists():
        raise InputError("there is such a file already; choose another name", str(path))
    write_whole(path, machine_text(path.stem, order, data).encode())
    load_machine(str(path))  # what is written here can be read
    return path


def _axis(number: int, data: Data) -> dict[str, Any]:
    table = {key: data[key] for key in _MODULE if data[key] != ""}
    return {
        "node": number,
        "unit": {"°": "deg"}.get(data["unit"], data["unit"]),
        "travel": [data["lowest"], data["highest"]],
        "resolution": 1.0 / data["counts_per_unit"],
        "module": table | {"matrix": [list(row) for row in data["matrix"]]},
    }


def _letter(data: Data) -> str:
    return str(data["axis"])
