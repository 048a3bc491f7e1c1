"""`rds scan`: who is on a bus."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.buses import Baud, Bitrate, Channel, Experiment, Interface, chosen_bus, refuse_baud
from rds.cli.common import Json, print_json, refusals, writes_files


@writes_files
def scan(
    watching: Annotated[
        bool, typer.Option("--watch", help="Go on, and say which distributed modules come and go, until Ctrl-C.")
    ] = False,
    events: Annotated[
        Path | None,
        typer.Option(help="With --watch: CSV file of what happens, for `rds report reconfiguration`."),
    ] = None,
    modules: Annotated[
        int | None, typer.Option(help="With --watch: how many there should be (default: as many as at its beginning).")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="With --watch: end after so long.")] = None,
    force: Annotated[bool, typer.Option("--force", help="With --events: overwrite the file.")] = False,
    interface: Interface = None,
    channel: Channel = None,
    bitrate: Bitrate = None,
    baud: Baud = None,
    experiment: Experiment = None,
    json: Json = False,
) -> None:
    """List the modules on a bus: number, type, dialect, version, state. Numbers used twice are refused.

    With --interface serial: the units on a serial line.
    """
    with refusals():
        from rds.core.errors import InputError

        _check_watch(watching, events=events, modules=modules, seconds=seconds, force=force or None)
        if force and events is None:
            raise InputError("--force overwrites the file of --events, which is not given")
        place = chosen_bus(interface, channel, experiment, bitrate)
        refuse_baud(place, baud)
        if watching:
            if place.is_line:
                raise InputError("--watch is for distributed modules on CAN; units on a serial line do not come and go")
            from rds.cli.watch import watch

            with place.opened() as bus:
                watch(bus, json, events, modules, seconds, force)
            return
        if place.is_line:
            from rds.bus.modules.dcs.scan import scan_channel

            rows = scan_channel(str(place.channel), place.baud(baud))
        else:
            from rds.bus.tools.scan import scan_all

            rows = scan_all(place.interface, place.channel, **place.options)
    if json:
        print_json({"channel": place.channel, "interface": place.interface, "modules": rows})
        return
    if not rows:
        typer.echo(f"no module answers on {place.name}; is a machine served, or switched on, at this bit rate?")
        return
    from rds.cli.console import show_table

    columns = ["id", "type", "dialect", "version", "state"]
    show_table("Modules", columns, [["–" if row[c] is None else str(row[c]) for c in columns] for row in rows])


def _check_watch(watching: bool, **words: Any) -> None:
    given = [f"--{name}" for name, value in words.items() if value is not None]
    if given and not watching:
        from rds.core.errors import InputError

        raise InputError(f"{', '.join(given)} belongs to --watch, which is not given")
