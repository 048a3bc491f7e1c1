"""Which units of a machine answer on a serial line."""

from __future__ import annotations

from typing import Any

from rds.bus.hub.bus_settings import DEFAULT_BAUD
from rds.bus.modules.dcs.frames import UNITS
from rds.bus.modules.dcs.host import Host
from rds.bus.modules.dcs.port import SerialPort, is_there
from rds.core.errors import MachineError
from rds.machines.machine import Machine


def find_units(machine: Machine, channel: str | None, baud: float | None = None, **options: Any) -> list[str]:
    """Names of the machine's axes whose units answer an inquiry; nothing moves. An empty list where no line is.

    MachineError if the line is there and can't be opened: another host commands it, or rights are missing.
    """
    where = machine.channel if channel is None else channel
    if not is_there(where):
        return []
    rate = DEFAULT_BAUD if baud is None else baud
    port = SerialPort(where, rate)
    found = []
    try:
        host = Host(port, rate, {}, where, tries=2)
        for axis in machine.axes.values():
            if axis.node not in UNITS:
                continue
            try:
                host.inquire(axis.node)
            except MachineError:
                continue
            found.append(axis.name)
    finally:
        port.close()
    return found
