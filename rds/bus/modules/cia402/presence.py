"""Whether each node-ID belongs to one device: all that have it answer, and their serial numbers tell them apart."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable

import can
import canopen

from rds.bus.modules.rds.identity import clash
from rds.bus.tools.listening import pause
from rds.core.errors import MachineError

_SERIAL = b"\x18\x10\x04"  # object 0x1018:04 in an SDO frame
_UPLOAD, _UPLOADED = 0x40, 0x40
WAIT = 0.05  # s for all answers


def refuse_clashes(network: canopen.Network, nodes: Iterable[int], wait: float = WAIT) -> None:
    """Ask the devices with these node-IDs for their serial numbers. MachineError naming those that share one.

    Two devices that give the same answer at the same bit are one to every listener: a device without a serial number
    of its own (0x1018:04) can't be told from another on a bus with bit timing.
    """
    answers: dict[int, list[str]] = {node: [] for node in nodes}

    def note(identifier: int, data: bytearray, _: float) -> None:
        if bytes(data[1:4]) == _SERIAL:
            has_one = data[0] & 0xE0 == _UPLOADED
            serial = f"serial number {int.from_bytes(data[4:8], 'little')}" if has_one else "no serial number"
            answers[identifier - 0x580].append(f"a device with {serial}")

    for node in answers:
        network.subscribe(0x580 + node, note)
    try:
        with contextlib.suppress(can.CanTimeoutError):  # with bit timing, nobody acknowledges where nobody is
            for node in answers:
                network.send_message(0x600 + node, bytes([_UPLOAD]) + _SERIAL + bytes(4))
        pause(wait)
    finally:
        for node in answers:
            network.unsubscribe(0x580 + node, note)
    for node, named in answers.items():
        if len(named) > 1:
            raise MachineError(clash(f"node-ID {node}", named))
