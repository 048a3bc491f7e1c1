"""`rds bus analyse`: load and worst-case response times before anything runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rds.commands.common import Json, print_json, refusals


def analyse(
    machine: Annotated[str, typer.Argument(help="A machine's name, or the path of its TOML file.")],
    bitrate: Annotated[int, typer.Option(help="Bit rate, bit/s.", min=1)] = 1_000_000,
    sample_period: Annotated[float | None, typer.Option(help="Sample period, s; by default the machine's.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Write the timeline and response times as a PNG.")] = None,
    json: Json = False,
) -> None:
    """Bus load, and every message's worst-case response time (Davis, Burns, Bril and Lukkien, 2007)."""
    with refusals():
        from rds.bus.analysis_report import analyse as analyse_bus
        from rds.machines import load_machine

        analysis = analyse_bus(load_machine(machine), bitrate, sample_period)
        if plot is not None:
            from rds.bus.analysis_plot import plot as draw

            draw(analysis).savefig(plot)
    if json:
        print_json(analysis.to_json())
    else:
        typer.echo(str(analysis))
    raise typer.Exit(0 if analysis.met else 1)
