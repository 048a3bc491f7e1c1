"""Last words of a drive that something is wrong with: its state and error code, asked for without the library."""

from __future__ import annotations

import contextlib
import time

import can

from rds.bus.modules.cia402.codes import State
from rds.bus.modules.cia402.remote import Remote

_PATIENCE = 0.1  # s
_ERROR_CODE = b"\x3f\x60\x00"  # object 0x603F:00 in an SDO frame
_FAULTS = (State.FAULT, State.FAULT_REACTION_ACTIVE)


def frame(identifier: int, data: bytes) -> can.Message:
    """A standard data frame."""
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data)


def ask(bus: can.BusABC, drive: Remote) -> int | None:
    """The error code of `drive`: that of its emergency message, else of object 0x603F; None if it doesn't say.

    Takes over the state FAULT from TPDOs that come meanwhile, and drops all other frames: the run is at its end.
    """
    code = drive.emergency or None
    with contextlib.suppress(can.CanError, OSError, ValueError):
        if code is None:
            bus.send(frame(0x600 + drive.node, b"\x40" + _ERROR_CODE + bytes(4)), 0.1)
        deadline = time.monotonic() + _PATIENCE
        while (code is None or drive.state not in _FAULTS) and (left := deadline - time.monotonic()) > 0.0:
            message = bus.recv(left)
            if message is None:
                continue
            identifier, data = message.arbitration_id, bytes(message.data)
            if identifier == 0x080 + drive.node and data[:2] != b"\0\0":
                code = int.from_bytes(data[:2], "little")
            elif identifier == 0x580 + drive.node and data[1:4] == _ERROR_CODE and data[0] & 0xE0 == 0x40:
                code = code or int.from_bytes(data[4:6], "little")
            elif identifier == drive.answers_at:
                before = drive.status, drive.state
                drive.take_status(message)
                if drive.state not in _FAULTS:  # what stop() has made of it isn't what was wrong
                    drive.status, drive.state = before
    return code
