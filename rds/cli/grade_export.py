"""`rds grade export`: grades into a gradebook."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files


@writes_files
def export(
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder that `rds grade run -o` made.")],
    to: Annotated[
        str,
        typer.Option(help="{gradebook}."),
    ],
    file: Annotated[
        Path | None, typer.Option("--out", "-o", help="The file, or folder, to write; by default a new one in OUT.")
    ] = None,
    gradebook: Annotated[
        Path | None,
        typer.Option(help="Your gradebook: as your platform exports it, or nbgrader's gradebook.db."),
    ] = None,
    column: Annotated[str | None, typer.Option(help="Its column; by default the assignment's title.")] = None,
    points: Annotated[float | None, typer.Option(min=0.0, help="What full marks are to be there.")] = None,
    json: Json = False,
) -> None:
    """Write the grades of a batch as a gradebook; who has no place in it is listed."""
    with refusals():
        from rds.grading.exports.export import export as write
        from rds.grading.exports.exported import ExportOptions

        done = write(out, to, file, ExportOptions(gradebook, column, points))
    if json:
        print_json(done.to_json())
    else:
        for note in done.notes:
            typer.echo(f"rds: note: {note}", err=True)
        typer.echo(f"{done.students} students: {done.place}")
    for student, reason in done.left_out.items():
        typer.echo(f"rds: left out: {student}: {reason}", err=True)
    raise typer.Exit(1 if done.left_out else 0)
