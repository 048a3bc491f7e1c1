"""Who is on a serial line, and its emergency stop.

A scan asks each of the fifteen identifiers by an inquiry, which moves nothing and changes nothing. A selection of the
thesis's own protocol would: a unit that is selected waits for 1500 bytes, in its firmware for ever.
"""

from __future__ import annotations

from typing import Any

from rds.bus.modules.dcs.frames import UNITS
from rds.bus.modules.dcs.host import Host, NoAnswer
from rds.bus.modules.dcs.port import LineTaken, Port, SerialPort
from rds.bus.modules.dcs.unit import SKIP
from rds.core.errors import MachineError

_TRIES = 2  # for each unit
_REPEATS = 4  # of a stop: a byte may be lost, and a unit that skips data hears nothing until there is silence
_ENDING = 1.0  # s in which a host whose units were reset ends its run

Row = dict[str, Any]  # id, type, dialect, version, state; counts, BLU


def scan_line(port: Port, baud: float, name: str = "serial") -> list[Row]:
    """The units that answer on the line behind `port`, by number."""
    host = Host(port, baud, {}, name, tries=1)
    found: dict[int, Row] = {}
    for _ in range(_TRIES):
        for number in set(UNITS) - found.keys():
            try:
                report = host.inquire(number)
            except NoAnswer:
                continue
            state = (report.status.name or "none").lower().replace("|", ", ").replace("_", " ").replace("none", "idle")
            about = {"id": number, "type": "unit", "dialect": "dcs", "version": None}
            found[number] = {**about, "state": state, "counts": report.counts}
    return [found[number] for number in sorted(found)]


def stop_line(port: Port, baud: float, name: str = "serial", *, commanded: bool = False) -> list[int]:
    """Stop all units; numbers of those that then say that they stand.

    On a line that another host has `commanded`, they are reset as well: they forget their set-up, take no further
    command of that host, and its run ends. MachineError naming the units that still move: then cut the power.
    """
    host = Host(port, baud, {}, name)
    for _ in range(_REPEATS):
        host.stop_all(hold=True)
        port.sleep(port.now() + SKIP * 1.2)
        if commanded:
            host.reset()
            port.sleep(port.now() + SKIP * 1.2)
    if commanded:  # and takes none of the answers any more
        port.sleep(port.now() + _ENDING)
    rows = scan_line(port, baud, name)
    if moving := [str(row["id"]) for row in rows if "moving" in row["state"]]:
        raise MachineError(f"units {', '.join(moving)} on line {name} still move; cut the power")
    return [row["id"] for row in rows]


def scan_channel(channel: str, baud: float) -> list[Row]:
    """The units on a served machine's line, or behind a real port. MachineError if it cannot be opened."""
    port = SerialPort(channel, baud)
    try:
        return scan_line(port, baud, channel)
    finally:
        port.close()


def stop_channel(channel: str, baud: float) -> list[int]:
    """Stop all units there, also while another host commands them. Errors as `stop_line`, and as `SerialPort`."""
    try:
        port, commanded = SerialPort(channel, baud), False
    except LineTaken:
        port, commanded = SerialPort(channel, baud, alone=False), True
    try:
        return stop_line(port, baud, channel, commanded=commanded)
    finally:
        port.close()
