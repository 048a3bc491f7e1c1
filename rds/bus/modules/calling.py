"""Which modules of a machine answer a call on a bus."""

from __future__ import annotations

from typing import Any

import can

from rds.bus.modules.rds import frames
from rds.bus.tools.link import BUILTIN, bus_failed, bus_name, default_channel, open_bus
from rds.bus.tools.listening import frames_within
from rds.machines.machine import Machine


def find_machine(
    machine: Machine, interface: str = BUILTIN, channel: str | None = None, timeout: float = 0.2, **options: Any
) -> list[str]:
    """Names of the machine's axes whose modules answer a call on this bus within `timeout` s; nothing else happens.

    Raises MachineError if the bus can't be opened or fails.
    """
    channel = default_channel(machine, interface, channel)
    names = {frames.answer_identifier(axis.node): axis.name for axis in machine.axes.values()}
    found: set[str] = set()
    bus = open_bus(interface, channel, sorted(names), node="scan", **options)
    try:
        bus.send(can.Message(arbitration_id=frames.CALL, is_extended_id=False, data=b""), timeout)
        for message in frames_within(bus, timeout):
            if message.arbitration_id in names and not message.is_error_frame:
                found.add(names[message.arbitration_id])
                if len(found) == len(names):
                    break
    except can.CanError as error:
        raise bus_failed(bus_name(interface, channel), error) from error
    finally:
        bus.shutdown()
    return [name for name in machine.axes if name in found]


def answering(machine: Machine, interface: str, channel: str | None, **options: Any) -> tuple[set[int], set[int]]:
    """The nodes of the machine's modules that answer a call, and those that identify themselves as distributed ones.

    Modules of the oacs dialect answer cyclic frames as well. Raises as `find_machine` does.
    """
    from rds.bus.modules.oacs.host import identify  # its messages take a while to read

    nodes = {machine.axis(name).node for name in find_machine(machine, interface, channel, **options)}
    if not nodes:
        return set(), set()
    bus = open_bus(interface, channel, node="scan", **options)
    try:
        return nodes, {info.id for info in identify(bus)}
    finally:
        bus.shutdown()
