"""The emergency stop, as a command."""

from __future__ import annotations

from typing import Annotated

import typer

from rds.cli.buses import Channel, Experiment, Interface, chosen_bus
from rds.cli.common import Json, print_json, refusals


def estop(
    reset: Annotated[bool, typer.Option("--reset", help="Release the latch of an emergency stop.")] = False,
    interface: Interface = None,
    channel: Channel = None,
    experiment: Experiment = None,
    json: Json = False,
) -> None:
    """Emergency stop of every module on a bus: zero volts, whatever its dialect; exit code 1 if nobody answers."""
    with refusals():
        from rds.bus.modules.dialects import dialect_names
        from rds.bus.tools.estop import reset_everything, stop_everything

        place = chosen_bus(interface, channel, experiment)
        with place.opened() as bus:
            acted = reset_everything(bus) if reset else stop_everything(bus)
    if reset:
        if json:
            print_json({"reset": acted})
        else:
            typer.echo(f"emergency stop reset; free: {', '.join(map(str, acted)) or 'no module answers'}")
        return
    if json:
        print_json({"stopped": acted})
    elif acted:
        typer.echo(f"emergency stop sent; acknowledged by {', '.join(map(str, acted))}")
    if not acted:
        typer.echo(
            f"rds: emergency stop sent on {place.name}, and nobody "
            f"acknowledged it; asked in the dialects {', '.join(dialect_names())}. If something moves, cut the power",
            err=True,
        )
        raise typer.Exit(1)
