"""`rds scan`: who is on a bus, once, or with --watch as they come and go."""

from __future__ import annotations

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer

from rds.cli.buses import Baud, BusOptions, refuse_baud
from rds.cli.common import Json, print_json, refusals, until_ctrl_c, writes_files

_INTERVAL = 0.1  # s between two looks; what is gone is noticed at the third


@writes_files
def scan(
    *,
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
    on_bus: BusOptions,
    baud: Baud = None,
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
        place = on_bus.chosen()
        refuse_baud(place, baud)
        if watching:
            if place.is_line:
                raise InputError("--watch is for distributed modules on CAN; units on a serial line do not come and go")
            with place.opened() as bus:
                _watch(bus, json, events, modules, seconds, force)
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


def _watch(bus: Any, json: bool, events: Path | None, modules: int | None, seconds: float | None, force: bool) -> None:
    """Watch the modules on an open bus until Ctrl-C, or for `seconds`; say and write down what happens."""
    from rds.bus.modules.oacs.events import EventFile, Reconfigurations

    with ExitStack() as stack:
        watching = Reconfigurations(bus, modules)
        file = EventFile(events, force) if events is not None else None
        if file is not None:
            stack.callback(file.close)
        stop = stack.enter_context(until_ctrl_c())
        ends = None if seconds is None else time.monotonic() + seconds
        rows: list[dict[str, Any]] = []
        while not stop.is_set() and (ends is None or time.monotonic() < ends):
            for happened in watching.look():
                if file is not None:
                    file.add(happened)
                rows.append({"time_s": round(happened.time, 3), "event": happened.event, "module": happened.module})
                if not json:
                    typer.echo(f"{happened.time:9.3f} s  {happened.event:8} {happened.module}")
            stop.wait(_INTERVAL)
    if json:
        print_json({"expected": watching.expected, "events": rows})
