"""The emergency stop, as a command."""

from __future__ import annotations

from typing import Annotated

import typer

from rds.commands.common import Channel, Interface, Json, print_json, refusals
from rds.commands.modules import bus_of, channel_of


def estop(
    reset: Annotated[bool, typer.Option("--reset", help="Release the latch of an emergency stop.")] = False,
    interface: Interface = "rds",
    channel: Channel = None,
    json: Json = False,
) -> None:
    """Emergency stop of every module on a bus: zero volts, whatever its dialect; exit code 1 if nobody answers."""
    with refusals(), bus_of(interface, channel) as bus:
        from rds.bus.dialects import dialect_names
        from rds.bus.estop import reset_everything, stop_everything

        if reset:
            free = reset_everything(bus)
            if json:
                print_json({"reset": free})
            else:
                typer.echo(f"emergency stop reset; free: {', '.join(map(str, free)) or 'no module answers'}")
            return
        stopped = stop_everything(bus)
    if json:
        print_json({"stopped": stopped})
    elif stopped:
        typer.echo(f"emergency stop sent; acknowledged by {', '.join(map(str, stopped))}")
    if not stopped:
        typer.echo(
            f"rds: emergency stop sent on {interface} channel {channel_of(interface, channel)}, and nobody "
            f"acknowledged it; asked in the dialects {', '.join(dialect_names())}. If something moves, cut the power",
            err=True,
        )
        raise typer.Exit(1)
