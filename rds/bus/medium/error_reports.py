"""Error frames as a node's own controller reports them: the format of Linux's SocketCAN (linux/can/error.h).

An error frame's identifier says what happened, as a set of classes; its eight bytes of data say more:

    1 state of the controller · 2 kind of bus error · 3 where · 6 transmit error counter · 7 receive error counter
"""

from __future__ import annotations

from rds.bus.hub import wire
from rds.bus.medium.confinement import WARNING, ErrorCounters, ErrorState

# classes
CONTROLLER, PROTOCOL, ACKNOWLEDGEMENT = 0x004, 0x008, 0x020
OFF, BUS_ERROR, RESTARTED, COUNTERS = 0x040, 0x080, 0x100, 0x200
DISTURBED = PROTOCOL | BUS_ERROR

# of the controller, data[1]
RX_WARNING, TX_WARNING, RX_PASSIVE, TX_PASSIVE, ACTIVE = 0x04, 0x08, 0x10, 0x20, 0x40
# of a bus error, data[2]
BIT_ERROR, WHILE_SENDING = 0x01, 0x80
_NAMES = {
    ACKNOWLEDGEMENT: "no acknowledgement",
    OFF: "bus off",
    RESTARTED: "restarted",
    PROTOCOL: "bus error while sending",
}
_STATES = {
    RX_WARNING: "receive warning",
    TX_WARNING: "transmit warning",
    RX_PASSIVE: "receive passive",
    TX_PASSIVE: "transmit passive",
    ACTIVE: "error active",
}


def report(kind: int, counters: ErrorCounters) -> bytes:
    """The wire record of an error of this kind: ACKNOWLEDGEMENT, DISTURBED or RESTARTED."""
    data = bytearray(8)
    if kind & PROTOCOL:
        data[2] = BIT_ERROR | WHILE_SENDING
    return _record(kind, data, counters)


def state_report(counters: ErrorCounters) -> bytes:
    """The wire record that tells the controller's state."""
    data = bytearray(8)
    if counters.state is ErrorState.OFF:
        return _record(OFF, data, counters)
    for counter, warning, passive in ((counters.tec, TX_WARNING, TX_PASSIVE), (counters.rec, RX_WARNING, RX_PASSIVE)):
        if counter >= 128:
            data[1] |= passive
        elif counter >= WARNING:
            data[1] |= warning
    data[1] = data[1] or ACTIVE
    return _record(CONTROLLER, data, counters)


def describe(identifier: int, data: bytes | bytearray) -> str:
    """An error frame in words."""
    parts = [name for bit, name in _NAMES.items() if identifier & bit]
    if identifier & CONTROLLER and len(data) > 1:
        parts += [name for bit, name in _STATES.items() if data[1] & bit]
    counters = f" (TEC {data[6]}, REC {data[7]})" if identifier & COUNTERS and len(data) > 7 else ""
    return (", ".join(parts) or f"error class {identifier:#x}") + counters


def _record(identifier: int, data: bytearray, counters: ErrorCounters) -> bytes:
    data[6], data[7] = min(counters.tec, 255), min(counters.rec, 255)
    header = wire.HEADER.pack(0, identifier | COUNTERS, wire.FRAME, wire.ERROR, 8, 8)
    return header + bytes(data).ljust(wire.DATA, b"\0")
