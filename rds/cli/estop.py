"""The emergency stop, as a command."""

from __future__ import annotations

from typing import Annotated

import typer

from rds.cli.buses import Baud, BusOptions, refuse_baud
from rds.cli.common import Json, print_json, refusals
from rds.cli.option_groups import grouped_options


@grouped_options
def estop(
    *,
    reset: Annotated[bool, typer.Option("--reset", help="Release the latch of an emergency stop.")] = False,
    on_bus: BusOptions,
    baud: Baud = None,
    json: Json = False,
) -> None:
    """Emergency stop of every module on a bus: zero volts, whatever its dialect; exit code 1 if nobody answers.

    With --interface serial: of every unit on a serial line, also while another host commands it.
    """
    with refusals():
        from rds.bus.modules.dcs.scan import stop_channel
        from rds.bus.modules.dialects import dialect_names
        from rds.bus.tools.estop import reset_everything, stop_everything
        from rds.core.errors import InputError

        place = on_bus.chosen()
        refuse_baud(place, baud)
        if place.is_line:
            if reset:
                raise InputError("units on a serial line latch no emergency stop; leave --reset out, and start again")
            acted, dialects = stop_channel(str(place.channel), place.baud(baud)), ["dcs"]
        else:
            dialects = dialect_names()
            with place.opened() as bus:
                acted = reset_everything(bus) if reset else stop_everything(bus)
    if reset:
        if json:
            print_json({"reset": acted})
        elif acted:
            typer.echo(f"emergency stop reset; free: {', '.join(map(str, acted))}")
        if not acted:
            typer.echo(
                f"rds: the reset was sent on {place.name}, and no module answers; check channel, power and bit rate",
                err=True,
            )
            raise typer.Exit(1)
        return
    if json:
        print_json({"stopped": acted})
    elif acted:
        typer.echo(f"emergency stop sent; acknowledged by {', '.join(map(str, acted))}")
    if not acted:
        asked = f"the dialects {', '.join(dialects)}" if len(dialects) > 1 else f"dialect {dialects[0]}"
        typer.echo(
            f"rds: emergency stop sent on {place.name}, and nobody "
            f"acknowledged it; asked in {asked}. If something moves, cut the power",
            err=True,
        )
        raise typer.Exit(1)
