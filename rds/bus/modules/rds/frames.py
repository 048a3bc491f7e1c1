"""The frames between host and axis modules: identifiers, and pure codecs from bytes to words.

All frames are little-endian, and standard (11-bit) but for the last:

| identifier | from   | bytes | content                                                                              |
| ---------- | ------ | ----- | ------------------------------------------------------------------------------------ |
| 0x001      | anyone | 1-8   | first byte 8: emergency stop of every module (the same frame as in the oacs dialect) |
| 0x00F      | host   | 8     | voltages of axes 5 to 8, as in 0x010; only where there are such, just before 0x010   |
| 0x010      | host   | 8     | cycle command and tick: four int16, see below                                        |
| 0x011      | host   | 8     | the same as a dry run: modules answer, and apply zero volts                          |
| 0x012      | host   | 8     | set-up: uint32 sample period in µs, uint32 reserved                                  |
| 0x013      | host   | 0     | call: every module reports, nothing else happens                                     |
|            |        | 1     | 8: emergency stop is reset, modules report; 9: every module says its identity;       |
|            |        |       | 10: every module says what its clock showed when this frame was on the bus           |
| 0x014 to   | host   | 2-8   | set points of methods A, B and C, and what goes with them: motion_frames.py          |
| 0x016      |        |       |                                                                                      |
| 0x01F      | module | 8     | float32 force in N that the load cell of the cutting head measured at a tick, uint16 |
|            |        |       | count of ticks heard, uint16 reserved; at every tenth tick                           |
| 0x020+node | module | 8     | int32 position counts, uint8 status, uint8 kind, uint16 count of ticks heard         |
| 0x1C000000 | module | 8     | identity; + serial number (24 bits): uint8 node, uint8 version, uint16 scale (0: it  |
|            |        |       | does not say), uint32 process (0: firmware); extended, so that two modules of one     |
|            |        |       | node never collide                                                                   |
| 0x1D000000 | module | 8     | clock; + node; uint64 ns of the module's own clock; extended                          |

A command's int16 are voltages in 20/65536 V with their two lowest bits clear, in axis order (or in that of the axes'
slots). Those bits, slot 0 lowest, make the command's number: its host's clock in half sample periods, 1 to 255 and
round again; 0 is a command by hand (see freshness.py). The lower identifier wins arbitration: a tick is never delayed
by an answer. The voltages' unit makes the levels of a 12-bit ±10 V converter (and of any other of up to 14 bits) exact.
On a machine whose converter has another range, 10 V stand for that.

A machine of five to eight axes gets its voltages in two frames and has one tick even so, 0x010 or 0x011, which is sent
last: all modules latch and act at it. Those of axes 5 to 8 take the voltages of the 0x00F before it, which has the same
number. A tick whose 0x00F was lost leaves their voltage as it was until its time is over; by hand, it means zero volts.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from enum import IntEnum, IntFlag
from math import isfinite
from struct import Struct
from typing import NamedTuple

from rds.core.errors import InputError, MachineError
from rds.core.shared_quantities import SAMPLE_PERIOD

GENERAL = 0x001  # a call to all modules of all dialects
MORE_VOLTAGES = 0x00F  # below the tick, for it goes first
COMMAND = 0x010
DRY_COMMAND = 0x011
SETUP = 0x012
CALL = 0x013
MOTION = range(0x014, 0x017)  # methods A, B and C: motion_frames.py
FORCE = 0x01F
FORCE_EVERY = 10  # ticks
ANSWER = 0x020  # + node
IDENTITY = 0x1C000000  # + serial number; extended
SERIALS = 1 << 24
CLOCK = 0x1D000000  # + node; extended

EMERGENCY = b"\x08" + bytes(7)  # data of GENERAL: zero volts until it is reset
RESET = b"\x08"  # data of CALL: release the latch of the emergency stop
WHO = b"\x09"  # data of CALL: say your identity
TIME = b"\x0a"  # data of CALL: say your clock at this frame
VERSION = 1  # of these frames

SLOTS = 4  # voltages in a frame
MOST_AXES = 2 * SLOTS  # of a machine
NODES = range(1, 0x60)  # so that answers end below 0x080, where CANopen's emergency and process data begin
VOLTS_PER_UNIT = 20.0 / 16384.0  # of a voltage: four of the int16's, whose two lowest bits carry the number
HIGHEST_VOLTAGE = 10.0  # V; sent as 10 V less one unit, for an int16 ends there
NUMBERS = 255  # of commands, 1 to 255; they count half sample periods
COUNT_TURNS = 1 << 16  # the tick count starts again at 0

# Standard identifiers of this dialect, first and last, and what a frame with one does to a machine.
IDENTIFIERS = (
    (GENERAL, GENERAL, "stops every module"),
    (COMMAND, COMMAND, "sets voltages"),
    (MORE_VOLTAGES, MORE_VOLTAGES, "sets the voltages of axes 5 to 8"),
    (DRY_COMMAND, DRY_COMMAND, "is a command's tick"),
    (SETUP, SETUP, "sets the sample period"),
    (CALL, CALL, "calls modules, or resets their emergency stop"),
    (MOTION[0], MOTION[-1], "moves axes by set points"),
    (FORCE, FORCE, "would pass for a measured force"),
    (ANSWER + NODES[0], ANSWER + NODES[-1], "would pass for a module's measured position"),
)

_VOLTAGES = Struct(f"<{SLOTS}h")
_NUMBER_BITS = 0x0003_0003_0003_0003
_SETUP = Struct("<II")
_IDENTITY = Struct("<BBHI")
_ANSWER = Struct("<iBBH")
_FORCE = Struct("<fHH")


class Status(IntFlag):
    """What a module says about itself."""

    NONE = 0
    ENABLED = 1  # it applies the voltage of its slot
    WATCHDOG = 2  # no command for 10 periods: zero volts until the next one
    DRY_RUN = 4  # the last command was a dry run: zero volts
    FAULT = 8  # it cannot do its part
    LIMIT = 0x10  # a limit switch is open: zero volts that way
    EMERGENCY = 0x20  # emergency stop: zero volts until it is reset
    NOT_SET_UP = 0x40  # no set-up since it was switched on: zero volts for numbered commands
    REFUSED = 0x80  # it has refused a command in the last 10 periods: too old, or of another host


class Kind(IntEnum):
    """Why a module speaks."""

    ANSWER = 0  # to a tick: the position is that at the tick
    REPORT = 1  # by itself or to a call: the position is that of now


class Identity(NamedTuple):
    """Which module it is."""

    node: int
    serial: int  # its own, 24 bits; of a virtual module, new with each start
    process: int = 0  # its process, if it is a virtual one
    version: int = VERSION
    scale: int = 0  # `scale` of its axis; 0: it does not say

    def __str__(self) -> str:
        where = f" in process {self.process}" if self.process else ""
        return f"module with serial number {self.serial}{where}"


class Answer(NamedTuple):
    """What a module says."""

    counts: int  # encoder counts (a spindle's speed in counts)
    status: int  # bits of Status
    kind: int  # Kind
    ticks: int  # ticks heard, modulo 65536


def encode_voltages(voltages: Sequence[float]) -> bytes:
    """Data of a command with up to four voltages in V, each rounded to the next unit; missing slots get 0 V.

    Raises InputError for one that is not a number from -10 to 10, or for more than four.
    """
    units = [0] * SLOTS
    if len(voltages) > SLOTS:
        raise InputError(f"{len(voltages)} voltages; one command carries {SLOTS}")
    for slot, voltage in enumerate(voltages):
        if not -HIGHEST_VOLTAGE <= voltage <= HIGHEST_VOLTAGE:  # false for NaN too
            raise InputError(f"voltage {voltage!r} V of slot {slot} must be from -10 to 10 V; limit it before")
        units[slot] = 4 * min(round(voltage / VOLTS_PER_UNIT), 8191)
    return _VOLTAGES.pack(*units)


def number_voltages(data: bytes, number: int) -> bytes:
    """Data of a command with this number, 0 to 255."""
    return (int.from_bytes(data, "little") & ~_NUMBER_BITS | _SPREAD[number]).to_bytes(8, "little")


def decode_number(data: bytes | bytearray) -> int:
    """The number of a command, 1 to 255; 0: it has none."""
    return data[0] & 3 | (data[2] & 3) << 2 | (data[4] & 3) << 4 | (data[6] & 3) << 6


_SPREAD = tuple(
    number & 3 | (number >> 2 & 3) << 16 | (number >> 4 & 3) << 32 | (number >> 6) << 48
    for number in range(NUMBERS + 1)
)


def decode_voltages(identifier: int, data: bytes | bytearray) -> tuple[float, ...]:
    """The four voltages of a command, V. MachineError if the length is wrong."""
    if len(data) != _VOLTAGES.size:
        raise _wrong(identifier, data, "a command", _VOLTAGES.size)
    return tuple((unit >> 2) * VOLTS_PER_UNIT for unit in _VOLTAGES.unpack(data))


def encode_setup(sample_period: float) -> bytes:
    """Data of a set-up frame; `sample_period` in s. InputError for one out of the range that holds everywhere."""
    return _SETUP.pack(round(SAMPLE_PERIOD.check(sample_period, "sample_period") * 1e6), 0)


def decode_setup(identifier: int, data: bytes | bytearray) -> float:
    """The sample period in a set-up frame, s. MachineError if the length is wrong or the period is 0."""
    if len(data) != _SETUP.size:
        raise _wrong(identifier, data, "a set-up", _SETUP.size)
    microseconds, _ = _SETUP.unpack(data)
    if microseconds == 0:
        raise MachineError(f"frame {identifier:#05x} sets a sample period of 0 µs")
    return float(microseconds * 1e-6)


def answer_identifier(node: int) -> int:
    """The identifier with which `node` (1 to 95) speaks; InputError for another."""
    if node not in NODES:
        raise InputError(f"node {node!r} must be from {NODES[0]} to {NODES[-1]}")
    return ANSWER + node


def encode_force(force: float, ticks: int) -> bytes:
    """Data of a measured force, N, at the tick that is number `ticks` of those heard."""
    return _FORCE.pack(force, ticks % COUNT_TURNS, 0)


def decode_force(data: bytes | bytearray) -> float:
    """The measured force, N. MachineError for data that are none."""
    if len(data) != _FORCE.size:
        raise MachineError(f"frame {FORCE:#05x} has {len(data)} bytes; a measured force has {_FORCE.size}")
    force: float = _FORCE.unpack(data)[0]
    if not isfinite(force):
        raise MachineError(f"frame {FORCE:#05x} says a force of {force} N; check the load cell")
    return force


def encode_answer(answer: Answer) -> bytes:
    """Data of an answer; the position wraps round as a 32-bit counter does, the tick count as a 16-bit one."""
    counts, status, kind, ticks = answer
    return _ANSWER.pack((counts + 0x80000000) % 0x100000000 - 0x80000000, status, kind, ticks % COUNT_TURNS)


def decode_answer(identifier: int, data: bytes | bytearray) -> Answer:
    """What a module says. MachineError if the length is wrong."""
    if len(data) != _ANSWER.size:
        raise _wrong(identifier, data, "an answer", _ANSWER.size)
    return Answer(*_ANSWER.unpack(data))


def encode_identity(identity: Identity) -> tuple[int, bytes]:
    """Identifier (extended) and data of the answer to the call WHO."""
    data = _IDENTITY.pack(identity.node, identity.version, identity.scale, identity.process & 0xFFFFFFFF)
    return IDENTITY + identity.serial % SERIALS, data


def decode_identity(identifier: int, data: bytes | bytearray) -> Identity | None:
    """Which module says it with this extended frame; None if it is another frame."""
    if not IDENTITY <= identifier < IDENTITY + SERIALS or len(data) != _IDENTITY.size:
        return None
    node, version, scale, process = _IDENTITY.unpack(data)
    return Identity(node, identifier - IDENTITY, process, version, scale)


def scale(unit: str, resolution: float, range: float) -> int:
    """What a module's counts and volts mean, in 16 bits: the lower ones of the CRC-32 of a text, such as "mm 0.001 10".

    Unit of the axis, its units per count, and the converter's range in V, the numbers with four digits: two files may
    write 1/600 with other ones. Never 0.
    """
    return zlib.crc32(f"{unit} {resolution:.4g} {range:.4g}".encode()) & 0xFFFF or 1


def encode_clock(node: int, seconds: float) -> tuple[int, bytes]:
    """Identifier (extended) and data of the answer to the call TIME."""
    return CLOCK + node, round(seconds * 1e9).to_bytes(8, "little")


def decode_clock(identifier: int, data: bytes | bytearray) -> tuple[int, float] | None:
    """Node, and its clock in s, that this extended frame tells; None if it is another frame."""
    if identifier - CLOCK not in NODES or len(data) != 8:
        return None
    return identifier - CLOCK, int.from_bytes(data, "little") * 1e-9


def _wrong(identifier: int, data: bytes | bytearray, what: str, size: int) -> MachineError:
    return MachineError(
        f"frame {identifier:#05x} carries {len(data)} bytes ({bytes(data).hex(' ') or 'none'}); {what} has {size}"
    )
