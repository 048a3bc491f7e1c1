"""The machine behind the bus of a run: one that is there already, or one started for this run."""

from __future__ import annotations

import secrets
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from math import ceil
from typing import Any

from rds.core.errors import InputError, MachineError
from rds.modes import load_mode
from rds.modes.loop.plan import Plan

BUILTIN = "rds"
_WARNED, _FULL = 80.0, 100.0  # % of the bus
_BITRATES = (125_000, 250_000, 500_000, 800_000, 1_000_000)  # of CiA 301
TIMING = ("bitrate", "data_bitrate")  # options that all nodes of a bus share


@contextmanager
def machine_behind(plan: Plan) -> Iterator[Plan]:
    """The plan with its bus settled.

    On a bus other than the built-in one, the machine is what is connected there. On the built-in bus, a machine
    that is served on the channel (by default the machine's name) is used; where there is none, or another run
    commands it, one is started for this run, on a channel of its own unless the channel was given. InputError if
    what answers on the channel speaks another dialect.
    """
    from rds.bus.modules.dialects import SERIAL_DIALECTS

    bus = {"interface": BUILTIN, **plan.bus}
    if bus.get("dialect") in SERIAL_DIALECTS:
        with _line_behind(plan, bus) as settled:
            yield replace(plan, bus=settled)
        return
    if bus["interface"] != BUILTIN:
        check_load(plan, bus, bus.get("bitrate"))
        yield replace(plan, bus=bus)
        return
    from rds.bus.hub.address import channels
    from rds.bus.hub.command import commanded, remove_left
    from rds.bus.modules.dialects import DEFAULT, is_served
    from rds.bus.modules.server_process import end_server, start_server
    from rds.bus.tools.link import default_channel, open_bus

    given, dialect = bus.get("channel"), bus.get("dialect", DEFAULT)
    channel = str(default_channel(plan.machine, BUILTIN, given))
    if (
        channel in channels()
        and (given or not commanded(channel))
        and is_served(dialect, plan.machine, BUILTIN, channel)
    ):
        with open_bus(BUILTIN, channel, [], node="look") as there:
            check_load(plan, bus, there.bitrate)  # type: ignore[attr-defined]
        yield replace(plan, bus=bus | {"channel": channel})
        return
    check_load(plan, bus, bus.get("bitrate"))
    if given is None:
        if channel in channels() and commanded(channel):
            _warn_of_own(plan, channel)
        channel = f"{plan.machine.channel[:20]}-{secrets.token_hex(4)}"
    remove_left()
    timing = {key: bus[key] for key in TIMING if key in bus}
    server = start_server(dialect, plan.machine.path, channel, timing)
    try:
        yield replace(plan, bus=bus | {"channel": channel})
    finally:
        end_server(server)


def _warn_of_own(plan: Plan, channel: str) -> None:
    """Where a machine is to move: it is not the one that is served, which somebody may stand beside and look at."""
    if load_mode(plan.mode).moves_machine:
        warnings.warn(
            f"another run commands the machine on channel {channel!r}: this run has a simulated machine of its own, "
            f"which nobody sees; to be refused instead, give channel = {channel!r} in [bus]",
            stacklevel=2,
        )


def check_load(plan: Plan, bus: Mapping[str, Any], bitrate: Any) -> None:
    """InputError for a bus that the run would fill above 100 %, a warning above 80 %; `bitrate` (bit/s) 0: no timing.

    What is taken for granted are the longest frames. On the built-in bus all modules of a machine are there, and
    answer; elsewhere those of the run's axes at least.
    """
    if not isinstance(bitrate, int) or bitrate <= 0:  # none, or one that the interface is going to refuse
        return
    from rds.bus.analysis.analysis_report import analyse
    from rds.bus.hub.bus_settings import BITRATE
    from rds.bus.modules.dialects import DEFAULT

    dialect, machine = str(bus.get("dialect", DEFAULT)), plan.machine
    if dialect == "cia402" or bus["interface"] != BUILTIN:
        names = {each.axis.name for each in plan.axes}
        machine = replace(machine, axes={name: axis for name, axis in machine.axes.items() if name in names})
    try:
        found = analyse(machine, BITRATE.check(bitrate, "bitrate"), plan.T, dialect=dialect, cia402=bus.get("cia402"))
    except InputError:  # of a table or a bit rate: said where it is read
        return
    load = found.worst_load_percent
    if load <= _WARNED:
        return
    period = ceil(plan.T * load / _WARNED * 1e5 - 1e-6) / 1e5
    rates = [rate for rate in _BITRATES if bitrate * load / _WARNED <= rate]
    remedy = f"a sample period of {period * 1e3:g} ms would do (sample_period = {period:g})"
    if rates:
        remedy += f", or {rates[0]} bit/s"
    modules = ", ".join(machine.axes)
    said = (
        f"command and answers of {modules} take {load:.0f} % of the bus at {bitrate} bit/s and a sample period of "
        f"{plan.T * 1e3:g} ms; {remedy}"
    )
    if load > _FULL:
        raise InputError(said)
    warnings.warn(said, stacklevel=2)


@contextmanager
def _line_behind(plan: Plan, bus: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """The same for a serial line: a port is what it is; a served machine is used; else one is started for this run."""
    from rds.bus.hub.bus_settings import OF_OWN_LINE, SERIAL
    from rds.bus.modules.dcs.port import is_device
    from rds.bus.modules.dialects import is_served
    from rds.bus.modules.server_process import end_server, start_server

    dialect, given = bus["dialect"], bus.get("channel")
    channel = str(plan.machine.channel if given is None else given)
    own = {key: bus[key] for key in OF_OWN_LINE if key in bus}
    settled = {key: value for key, value in bus.items() if key not in own} | {"interface": SERIAL, "channel": channel}
    baud = {"baud": bus["baud"]} if "baud" in bus else {}
    try:
        served = is_device(channel) or is_served(dialect, plan.machine, SERIAL, channel, **baud)
    except MachineError:
        if given is not None:
            raise
        served = False  # another host has it
        _warn_of_own(plan, channel)
    if served:
        if own:
            raise InputError(
                f"[bus] {', '.join(own)} is for a line that the run starts itself, and {channel} is there already; "
                "choose another channel, or give it to `rds machine serve`"
            )
        yield settled
        return
    if given is None:
        channel = f"{plan.machine.channel[:20]}-{secrets.token_hex(4)}"
    if isinstance(own.get("drift"), dict):
        own["drift"] = ",".join(f"{name}:{value}" for name, value in own["drift"].items())
    server = start_server(dialect, plan.machine.path, channel, own | baud)
    try:
        yield settled | {"channel": channel}
    finally:
        end_server(server)
