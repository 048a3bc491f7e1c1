"""Machine files from estimates: a known machine, one axis of which is what was found of it."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.toml_file import read_toml
from rds.core.toml_text import toml_text
from rds.identification.fit.model_file import ModelFile, read_model
from rds.identification.fit.run_model import checked_structure, library_table, run_model
from rds.machines import load_machine
from rds.models.machine_axis import MachineParameters


def write_machine(path: str | Path, model: ModelFile | str | Path, base: str, axis: str) -> Path:
    """Write the machine `base` (a name or a file) to `path` with `axis` as the model file says, whole or not at all.

    The axis's `model` is what was estimated, and so is the machine behind the bus (`machine`). What the file has
    besides - travel, resolution, limits, other axes - stays what it was. InputError for an axis that the machine does
    not have or that is measured in another unit, and for a student's structure, which is no machine.
    """
    path = Path(path)
    if path.suffix != ".toml":
        raise InputError("a machine file is TOML; give it a name that ends in .toml", str(path))
    file = model if isinstance(model, ModelFile) else read_model(model)
    machine = load_machine(base)
    unit = machine.axis(axis).unit
    if file.is_student:
        raise InputError(
            "its structure is a student's file, which no machine is made of; fit `--structure axis`", file.path
        )
    run_model(file, unit=unit)  # whatever will not do is said here
    table = library_table(checked_structure(file), file.values())
    known = {field.name for field in fields(MachineParameters)}
    if unknown := [name for name in table if name not in {"name", *known}]:
        raise InputError(
            f"its {' and '.join(unknown)} no machine is made of; fit it without {', '.join(file.options)}, or take the "
            'model file in experiments ([model] file = "...")',
            file.path,
        )
    data, _ = read_toml(machine.path)
    data["name"] = path.stem
    data["axis"][axis] |= {"model": table, "machine": {key: v for key, v in table.items() if key in known}}
    header = f"{machine.name} with axis {axis} as estimated: {Path(file.path).name}, SHA-256 {file.sha256[:16]}..."
    write_whole(path, toml_text(data, header).encode())
    return path
