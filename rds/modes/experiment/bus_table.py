"""The [bus] table of an experiment: what can.Bus gets, and how each axis is commanded over it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rds.bus.hub.bus_settings import SERIAL, bus_fault, serial_fault
from rds.bus.medium.fault_file import read_faults
from rds.bus.modules.dialects import SERIAL_DIALECTS, bus_interface
from rds.core.errors import InputError
from rds.core.quantities import Choice
from rds.core.toml_table import TomlTable
from rds.machines import Machine
from rds.modes.experiment.drives import commands_of
from rds.modes.experiment.parts import named
from rds.modes.loop.commands import Command
from rds.modes.process.machine import BUILTIN


def bus_table(words: TomlTable, folder: Path, machine: Machine | None = None) -> dict[str, Any]:
    """The keyword arguments of can.Bus; python-can itself knows which options an interface has.

    On the built-in bus also "faults", the schedule that is injected during the run. Where neither interface nor dialect
    is said, a `machine` whose modules are units of a serial line is there.
    """
    table = words.inner("bus")
    units = machine is not None and bus_interface(machine, {} if table is None else table.table) == SERIAL
    if table is None:
        return {"interface": SERIAL, "dialect": SERIAL_DIALECTS[0]} if units else {}
    interface = table.read("interface")
    channel = table.any("channel")
    if channel is not None and (isinstance(channel, bool) or not isinstance(channel, str | int)):
        raise table.fault("channel", "must be the name or the number of a channel")
    dialect = table.read("dialect")
    if units or dialect in SERIAL_DIALECTS or (interface == SERIAL and "dialect" not in table):
        if (wrong := serial_fault(table.table)) is not None:
            raise table.fault(*wrong)
        return {**table.table, "interface": SERIAL, "dialect": SERIAL_DIALECTS[0]}
    if (wrong := bus_fault(table.table)) is not None and (wrong[0] == "cia402" or interface != BUILTIN):
        raise table.fault(*wrong)
    table.any("cia402")
    if interface == BUILTIN:
        table.read("bitrate")
        table.read("data_bitrate")
        if "data_bitrate" in table and "bitrate" not in table:
            raise table.fault("data_bitrate", "needs a bitrate beside it: only a bus with bit timing has a data rate")
        table.read("restart_ms")
        file = table.read("faults")
        table.done()
        return dict(table.table) | ({} if file is None else {"faults": read_faults(folder / file)})
    if "faults" in table:
        raise table.fault("faults", "can be injected on the built-in bus only; remove it, or the interface")
    from can.interfaces import VALID_INTERFACES

    if (fault := Choice("interface", sorted(VALID_INTERFACES)).fault(interface)) is not None:
        raise table.fault("interface", fault)
    return dict(table.table)


def bus_commands(
    words: TomlTable, bus: dict[str, Any], machine: Machine, names: list[str], driven: str
) -> dict[str, Command]:
    """How each axis is commanded over this bus; a drive's own loops take references, and no voltage signals."""
    table = words.inner("bus")
    with named(words if table is None else table):
        commands = commands_of(bus, machine, names)
    others = [name for name, command in commands.items() if command is not Command.VOLTAGE]
    if not others:
        return commands
    assert table is not None
    if driven == "signal":
        raise InputError(
            f"a signal is a voltage, and the drive of axis {others[0]} takes a {commands[others[0]].quantity}: use "
            'mode = "cst" in [bus.cia402], or a [reference]',
            table.place("cia402"),
        )
    if driven == "program" and (slow := [name for name, command in commands.items() if command is Command.PROFILE]):
        raise InputError(
            f'mode = "pp" moves axis {slow[0]} by a profile of its own, so that it leaves a path that axes follow '
            'together: use mode = "csp"',
            table.place("cia402"),
        )
    return commands
