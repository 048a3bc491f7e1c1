"""The machine behind the bus of a run: one that is there already, or one started for this run."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from rds.modes.loop.plan import Plan

BUILTIN = "rds"
TIMING = ("bitrate", "data_bitrate")  # options that all nodes of a bus share


@contextmanager
def machine_behind(plan: Plan) -> Iterator[Plan]:
    """The plan with its bus settled.

    On a bus other than the built-in one, the machine is what is connected there. On the built-in bus, a machine
    that is served on the channel (by default the machine's name) is used; where there is none, or another run
    commands it, one is started for this run, on a channel of its own unless the channel was given. InputError if
    what answers on the channel speaks another dialect.
    """
    bus = {"interface": BUILTIN, **plan.bus}
    if bus["interface"] != BUILTIN:
        yield replace(plan, bus=bus)
        return
    from rds.bus.hub.address import channels
    from rds.bus.hub.command import commanded, remove_left
    from rds.bus.modules.dialects import DEFAULT, is_served
    from rds.bus.modules.server_process import end_server, start_server
    from rds.bus.tools.link import default_channel

    given, dialect = bus.get("channel"), bus.get("dialect", DEFAULT)
    channel = str(default_channel(plan.machine, BUILTIN, given))
    if (
        channel in channels()
        and (given or not commanded(channel))
        and is_served(dialect, plan.machine, BUILTIN, channel)
    ):
        yield replace(plan, bus=bus | {"channel": channel})
        return
    if given is None:
        channel = f"{plan.machine.name[:20]}-{secrets.token_hex(4)}"
    remove_left()
    timing = {key: bus[key] for key in TIMING if key in bus}
    server = start_server(dialect, plan.machine.path, channel, timing)
    try:
        yield replace(plan, bus=bus | {"channel": channel})
    finally:
        end_server(server)
