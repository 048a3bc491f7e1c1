"""The emergency stop of CiA 402 drives whose node-IDs nobody knows: their power off, and what they say of it.

A drive may ignore the stop of the network (option code 0x6007 = 0, CiA 402), and nothing answers it. So every node is
also told, by SDO, to disable its voltage; the answer, and the statusword that it shows then, are the acknowledgement.
"""

from __future__ import annotations

import time

import can

from rds.bus.modules.cia402.codes import DISABLE_VOLTAGE, NODES, State, state_of
from rds.bus.tools.listening import frames_within

_REQUEST, _ANSWER = 0x600, 0x580
_CUT = b"\x2b\x40\x60\x00" + DISABLE_VOLTAGE.to_bytes(2, "little") + bytes(2)  # write controlword 0x6040
_CUT_DONE = b"\x60\x40\x60\x00"
_LOOK = b"\x40\x41\x60\x00" + bytes(4)  # read statusword 0x6041
_LOOK_DONE = b"\x4b\x41\x60\x00"
_ROUNDS = 2  # a frame may be lost
_ANSWERS = 0.1  # s
_RAMPS = 0.5  # s for a ramp that the drive ends with its power off
_POWERED = (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)


def cut(bus: can.BusABC) -> dict[int, bool]:
    """Disable the voltage of every drive on an open `bus`; by node-ID, whether it says that it has none now.

    Drives must answer SDOs, so not be in the NMT state STOPPED. Raises can.CanError or OSError if the bus fails.
    """
    found: set[int] = set()
    for _ in range(_ROUNDS):
        for node in NODES:
            if node not in found:
                bus.send(_frame(node, _CUT), 0.2)
        found |= set(_answers(bus, _CUT_DONE))
    off: dict[int, bool] = dict.fromkeys(found, False)
    until, is_over = time.monotonic() + _RAMPS, False
    while not all(off.values()) and not is_over:
        is_over = time.monotonic() >= until  # then they are asked once more: this process may have stood still
        asked = [node for node, is_off in off.items() if not is_off]
        for node in asked:
            bus.send(_frame(node, _LOOK), 0.2)
        for node, data in _answers(bus, _LOOK_DONE, len(asked)).items():
            if node in off:
                off[node] = state_of(int.from_bytes(data[4:6], "little")) not in (*_POWERED, None)
    return off


def _answers(bus: can.BusABC, begin: bytes, enough: int = len(NODES)) -> dict[int, bytes]:
    """The SDO answers of the next tenth of a second that begin so, by node-ID; `enough` of them end the wait."""
    found: dict[int, bytes] = {}
    for message in frames_within(bus, _ANSWERS):
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame:
            continue
        node = message.arbitration_id - _ANSWER
        if node in NODES and bytes(message.data[:4]) == begin:
            found[node] = bytes(message.data)
            if len(found) >= enough:
                break
    return found


def _frame(node: int, data: bytes) -> can.Message:
    return can.Message(arbitration_id=_REQUEST + node, is_extended_id=False, data=data)
