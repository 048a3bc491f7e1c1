"""`rds nc methods`: interpolators beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, progress_bars, refusals, writes_files
from rds.cli.nc_options import ProgramOptions


@writes_files
def methods(
    file: Annotated[Path, typer.Argument(help="A path file (.toml) or a part program.")],
    reading: ProgramOptions,
    add: Annotated[
        list[Path] | None, typer.Option(help="Your .py file with interpolate(), beside the library's; can be repeated.")
    ] = None,
    machine: Annotated[
        str, typer.Option("--machine", help="A machine's name, or the path of its TOML file.")
    ] = "mini-cnc",
    controller: Annotated[
        str | None,
        typer.Option(help="Of the position axes: a name, or your .py file (default as of `rds nc run`)."),
    ] = None,
    acceleration: Annotated[
        str | None, typer.Option(help="Filter on top of each: linear, exponential or s-shape.")
    ] = None,
    acceleration_time: Annotated[
        float | None, typer.Option(help="How long the velocity rises, s; of exponential its time constant.")
    ] = None,
    plant: Annotated[
        str, typer.Option(help="machine: the axes behind the bus, friction, play and delay included; or model.")
    ] = "machine",
    period: Annotated[float | None, typer.Option(help="Sample period, s (default the machine's).")] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the table, the picture and a page.")
    ] = None,
    json: Json = False,
) -> None:
    """Compare interpolators on a simulated machine: contour error, feed ripple, jerk, and compute time of a sample."""
    with refusals():
        from rds.cli.interpolate import acceleration_of
        from rds.core.errors import InputError
        from rds.machines import load_machine
        from rds.modes.experiment.folder import require_writable
        from rds.nc.run.methods import compare_methods, methods_report
        from rds.nc.run.run import usual_controller
        from rds.results.reports.write import write

        if plant not in ("machine", "model"):
            raise InputError(f"--plant {plant!r} must be machine or model")
        if out is not None:
            require_writable(out)
        filter_ = acceleration_of(acceleration, acceleration_time, None, False)
        with progress_bars() as bar:
            compared = compare_methods(
                file,
                add or (),
                machine=machine,
                controller=controller,
                acceleration=filter_,
                sample_period=period,
                as_built=plant == "machine",
                setup=reading.setup(),
                progress=bar("methods"),
            )
        law = controller or usual_controller(load_machine(machine))
        settings = {"machine": machine, "plant": plant, "controller": law, "acceleration": acceleration}
        made = methods_report(compared, file, settings)
        files = write(made, out) if out is not None else []
    if json:
        print_json({**made.to_json(), "files": [str(path) for path in files]})
        return
    from rds.cli.console import cell, show_table

    for table in made.tables:
        show_table(table.title, table.columns, [[cell(value) for value in row] for row in table.shown()], table.note)
    for sentence in made.findings:
        typer.echo(f"- {sentence}")
    if files:
        typer.echo(f"page: {files[0]}")
