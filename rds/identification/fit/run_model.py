"""From a model file to a model that runs: the library's where one says the same, else the student's own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.core.integrate import SUBSTEPS
from rds.core.load import StudentFile, load_student
from rds.core.types import SPINDLE_UNIT, Model, Source
from rds.identification.fit.model_file import ModelFile, file_sha256, read_model
from rds.identification.structures.signals import POSITIONS, VOLTS
from rds.identification.structures.structure import Structure
from rds.identification.structures.structures import structure
from rds.models import library_model
from rds.models.machine_model import MachineAxisMotion
from rds.models.spindle import SpindleMotion
from rds.models.student import student_model

if TYPE_CHECKING:
    from rds.checks import FileReport


def run_model(
    file: ModelFile,
    unit: str | None = None,
    per_volt: float | None = None,
) -> Model:
    """The model of a model file, exact for every option of its structure.

    `unit` is that of the axis's position, where it is known: a spindle's model is for "rev/min", one that turns for
    "deg". `per_volt` is how many units of its command the drive makes of a volt, for a model that is commanded in
    another unit. Raises InputError where names or units are not those of the structure, a value will not do, or a
    student's file is not the one that was fitted.
    """
    if not file.is_student:
        _check_unit(file, unit)
        _check_command(file, per_volt)
    try:
        if file.is_student:
            model = student_model(student_structure(file), file.values(), SUBSTEPS)
        else:
            table = library_table(checked_structure(file), file.values(), per_volt or 1.0)
            model = library_model(table.pop("name"), **table)
    except InputError as error:
        raise error if error.where else InputError(str(error), file.path) from error
    path = Path(file.path)
    return replace(model, fitted=Source(path.name, str(path.resolve()), file.sha256, file.text))


def check_model_file(path: str | Path, sample_period: float = 0.001) -> FileReport:
    """The check of a model file: that it can be read and used, and that its model keeps its interface."""
    from rds.checks import FileReport, check_model

    file = read_model(path)
    model = replace(run_model(file), source=Source(Path(path).name))
    delay = model.params.get("delay", 0.0) if model.motion in (MachineAxisMotion, SpindleMotion) else 0.0
    if delay:  # the voltages that wait are states, as many as there are samples in the delay
        model = replace(model, params={**model.params, "delay": 0.0})
    report = check_model(model, sample_period)
    notes = [*file.doubts(), *([f"checked without its delay of {delay:g} s"] if delay else [])]
    return FileReport(str(path), (replace(report, notes=(*report.notes, *notes)),))


def checked_structure(file: ModelFile) -> Structure:
    """The structure of a model file, if its parameters have that structure's names and units; else InputError."""
    made = structure(file.structure, file.options, file.output_unit, file.command_unit)
    given, wanted = file.units(), dict(made.units)
    for name in made.parameters:
        if name not in given:
            raise InputError(f"{_named(made)} has a parameter {name}, which is missing; add [parameters.{name}]")
    for name, unit in given.items():
        if name not in wanted:
            raise InputError(f"{_named(made)} has no parameter {name!r}; it has {', '.join(made.parameters)}")
        if unit != wanted[name]:
            raise InputError(f"parameters.{name}.unit = {unit!r} must be {wanted[name]!r}; convert the values to it")
    return made


def library_table(made: Structure, values: Mapping[str, float], per_volt: float = 1.0) -> dict[str, Any]:
    """The `[model]` table of the library model that moves as the structure does, `name` included.

    The plain linear axis where that is enough, as it is what compiles; else the machine's own axis, with all options.
    Its numbers are for a position in mm or degrees (a spindle's speed in rev/min) and a command in V, of which the
    drive makes `per_volt` of the structure's command each.
    """
    table = _table(made, values)
    if "K" in table:
        table["K"] = table["K"] * per_volt
    return table | {name: table[name] / per_volt for name in ("offset", "dead_zone") if name in table}


def _table(made: Structure, values: Mapping[str, float]) -> dict[str, Any]:
    if made.as_model is not None:
        table = made.as_model(values)
        if table["name"] != "linear-axis" or table["friction_plus"] >= 0.0 >= table["friction_minus"]:
            return table
    table = dict(values)
    if "friction" in table:
        table["friction_plus"] = table.pop("friction")
        table["friction_minus"] = -table["friction_plus"]
    times = POSITIONS[made.output_unit][1]
    speeds = ("K", "friction_plus", "friction_minus", "stribeck_velocity")
    return {"name": "machine-axis", **table, **{name: times * table[name] for name in speeds if name in table}}


def _check_unit(file: ModelFile, unit: str | None) -> None:
    """InputError where the axis is measured in another unit than the model's."""
    is_spindle = file.structure == "spindle"
    own = SPINDLE_UNIT if is_spindle else POSITIONS[file.output_unit][0] if file.output_unit in POSITIONS else None
    if unit is None or ((own or unit) == unit and is_spindle == (unit == SPINDLE_UNIT)):
        return
    what = "a spindle" if is_spindle else "an axis that turns" if own == "deg" else "a linear axis"
    raise InputError(f"it is a model of {what}, and this axis is measured in {unit}", file.path)


def _check_command(file: ModelFile, per_volt: float | None) -> None:
    if file.command_unit == VOLTS or per_volt is not None:
        return
    raise InputError(
        f"its command is in {file.command_unit}, and a machine's converter gives V: nothing says what the drive makes "
        f"of a volt; make a machine of it (`rds machine from ... --per-volt 0.5`, for 0.5 {file.command_unit} per V)",
        file.path,
    )


def _named(made: Structure) -> str:
    options = f" with {', '.join(made.options)}" if made.options else ""
    return f"structure {made.name}{options}"


def student_structure(file: ModelFile) -> StudentFile:
    """The student's file that a model file names; InputError if it is not the one that was fitted."""
    path = Path(file.structure)
    if file.structure_sha256 and path.is_file() and file_sha256(path) != file.structure_sha256:
        raise InputError(
            f"{path.name} has changed since it was fitted (structure_sha256); fit it again, or take that line out if "
            "the change does not matter",
            file.path,
        )
    return load_student(path)
