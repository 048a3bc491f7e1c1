"""`rds schema`: the JSON Schema of each kind of file, by which an editor completes and checks as one types."""

from __future__ import annotations

import json as json_text
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.common import refusals, writes_files

DIALECT = "http://json-schema.org/draft-07/schema#"  # what Taplo, and with it Even Better TOML, reads
KINDS = ("experiment", "machine", "assignment", "map", "path", "faults", "model")


@writes_files
def schema(
    kind: Annotated[
        str | None, typer.Argument(help=f"Kind: {', '.join(KINDS)}. Without it, the shipped files are listed.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Write all of them into this folder.")] = None,
) -> None:
    """Print the JSON Schema of a kind of file, or where the shipped ones are; an editor checks files by them."""
    with refusals():
        from rds.core.errors import InputError
        from rds.core.private_files import make_folder, write_private

        if kind is not None and kind not in KINDS:
            from rds.core.quantities import near

            raise InputError(f"there are no files of kind {kind!r}; known kinds: {', '.join(KINDS)}{near(kind, KINDS)}")
        if out is not None:
            make_folder(out)
            for each in KINDS if kind is None else (kind,):
                write_private(out / f"{each}.json", schema_text(each).encode())
        elif kind is not None:
            typer.echo(schema_text(kind), nl=False)
        else:
            for each in KINDS:
                typer.echo(f"{each:12} {shipped(each)}")


def shipped(kind: str) -> Path:
    """The file of a schema that comes with the package."""
    return Path(str(files("rds.cli").joinpath("schemas", f"{kind}.json")))


def schema_text(kind: str) -> str:
    """The JSON Schema of files of this kind, made from the declarations that their reader uses."""
    made = {"$schema": DIALECT, "title": f"RDS {kind} file", **_declared(kind).schema()}
    return json_text.dumps(made, indent=1, ensure_ascii=False) + "\n"


def _declared(kind: str) -> Any:
    if kind == "experiment":
        from rds.modes.experiment.experiment_file import EXPERIMENT

        return EXPERIMENT
    if kind == "machine":
        return _machine()
    if kind == "assignment":
        from rds.grading.assignment.assignment_file import ASSIGNMENT

        return ASSIGNMENT
    if kind == "map":
        from rds.identification.logs.map_file import MAP

        return MAP
    if kind == "path":
        from rds.interpolators.segment_rows import SEGMENTS

        return SEGMENTS
    if kind == "faults":
        from rds.bus.medium.fault_file import FAULTS

        return FAULTS
    from rds.identification.fit.model_file import MODEL_FILE

    return MODEL_FILE


def _machine() -> Any:
    """The machine's file with the parameters of its models, which the room of machines does not know."""
    from rds.core.quantities import Table
    from rds.machines.machine import AXIS, MACHINE
    from rds.models import model_module, model_names
    from rds.models.machine_axis import PARAMETERS
    from rds.models.stepper_axis import PARAMETERS as STEPPER

    parameters: Mapping[str, Any] = {}
    for name in model_names():
        parameters = {**model_module(name).PARAMETERS, **parameters}
    model, behind = AXIS.keys["model"], AXIS.keys["machine"]
    assert isinstance(model, Table) and isinstance(behind, Table)
    keys = {
        **AXIS.keys,
        "model": replace(model, keys={**model.keys, **parameters}, others=None),
        "machine": replace(behind, keys=STEPPER | PARAMETERS, others=None),
    }
    axes = MACHINE.keys["axis"]
    assert isinstance(axes, Table)
    return replace(MACHINE, keys={**MACHINE.keys, "axis": replace(axes, others=replace(AXIS, keys=keys))})
