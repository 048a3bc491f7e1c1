"""The order of modules in the panel, and the file of the machine that they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.atomic import write_whole
from rds.core.errors import InputError, RdsError
from rds.machines import load_machine
from rds.machines.assembly import Order, assembled, machine_text

# of a machine whose file was written
NEXT_STEP = "Choose it as Machine at Modules to start its modules here; Help says how the whole page begins with it"


def moved(order: Sequence[int | str], number: int | str, by: int) -> list[int | str]:
    """The order with one module moved towards the work (+1) or the tool (-1); at its end it stays."""
    place = list(order).index(number)
    target = min(max(place + by, 0), len(order) - 1)
    rest = [each for each in order if each != number]
    return [*rest[:target], number, *rest[target:]]


def machine_files(folder: Path) -> list[Path]:
    """The machines' files of a folder, by name; what cannot be read is none of them."""
    return [path for path in sorted(folder.glob("*.toml")) if not path.name.startswith(".") and _is_machine(path)]


def _is_machine(path: Path) -> bool:
    try:
        load_machine(str(path))
    except RdsError:
        return False
    return True


def directions(order: Order, data: Mapping[int, Any]) -> dict[str, tuple[str, np.ndarray]]:
    """For each axis whether it shifts or turns, and in which direction (unit vector) seen from the tool, at zero."""
    kinematics = assembled("machine", order, data).kinematics
    zero = np.zeros((1, len(kinematics.joints)))
    ways = kinematics.axes(zero)[0][0] @ kinematics.forward(zero)[0, :3, :3]
    return {
        name: ("turns" if turns else "shifts", way)
        for name, turns, way in zip(kinematics.joints, kinematics.turns, ways, strict=True)
    }


def write_machine(folder: Path, file: str, order: Order, data: Mapping[int, Any]) -> Path:
    """Write the machine's file into `folder`; InputError for a name that will not do, or a file that is there."""
    return write_machine_text(folder, file, lambda name: machine_text(name, order, data))


def write_machine_text(folder: Path, file: str, text: Callable[[str], str]) -> Path:
    """The same for the `text` of a machine's name."""
    if Path(file).name != file or not file.endswith(".toml") or file.startswith("."):
        raise InputError(f"{file!r} must be a plain name that ends with .toml, as in my-machine.toml")
    path = folder / file
    if path.exists():
        raise InputError("there is such a file already; choose another name", str(path))
    write_whole(path, text(path.stem).encode())
    load_machine(str(path))  # what is written here can be read
    return path
