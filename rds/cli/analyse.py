"""`rds bus analyse`: load and worst-case response times before anything runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.cli.common import Json, print_json, refusals, writes_files


@writes_files
def analyse(
    machine: Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.")],
    bitrate: Annotated[int, typer.Option(help="Bit rate, bit/s.", min=1)] = 1_000_000,
    sample_period: Annotated[float | None, typer.Option(help="Sample period, s; by default the machine's.")] = None,
    dialect: Annotated[str, typer.Option(help="What the modules speak: rds, oacs or cia402.")] = "rds",
    response_time: Annotated[
        float, typer.Option(help="Longest time from a command's arrival to a module's answer being ready, s.")
    ] = 0.0,
    host_jitter: Annotated[float, typer.Option(help="How late the host can be, s.")] = 0.0,
    errors: Annotated[int, typer.Option(help="Frames that are disturbed at once, to be reckoned with.", min=0)] = 0,
    error_interval: Annotated[
        float | None, typer.Option(help="One more is disturbed every so many s; alone, --errors 1.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Write the timeline and response times as a PNG.")] = None,
    json: Json = False,
) -> None:
    """Bus load, and every message's worst-case response time (Davis, Burns, Bril and Lukkien, 2007)."""
    with refusals():
        from math import inf

        from rds.bus.analysis.analysis_report import analyse as analyse_bus
        from rds.bus.analysis.response_times import Errors
        from rds.machines import load_machine

        interval = inf if error_interval is None else error_interval
        analysis = analyse_bus(
            load_machine(machine),
            bitrate,
            sample_period,
            dialect=dialect,
            response_time=response_time,
            host_jitter=host_jitter,
            errors=Errors(errors or 1, interval) if errors or error_interval is not None else None,
        )
        if plot is not None:
            from rds.bus.analysis.analysis_plot import plot as draw
            from rds.core.atomic import write_files

            picture, kind = draw(analysis), plot.suffix.removeprefix(".") or "png"
            write_files({plot: lambda stream: picture.savefig(stream, format=kind)})
    if json:
        print_json(analysis.to_json())
    else:
        typer.echo(str(analysis))
        if plot is not None:
            typer.echo(f"plot: {plot}")
    raise typer.Exit(0 if analysis.met else 1)
