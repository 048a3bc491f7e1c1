"""The frames of methods A, B and C on CAN: set points to nodes that close their own position loop.

All frames are little-endian. Those of the host are standard ones, those of the modules extended ones:

| identifier | from   | bytes | content                                                                                |
| ---------- | ------ | ----- | -------------------------------------------------------------------------------------- |
| 0x014      | host   | 8     | set points of method A: four uint16, of axes 1 to 4; every module answers as to a tick |
| 0x015      | host   | 3-8   | data: uint8 node, uint8 number of the piece modulo 256, 1 to 6 bytes of its buffer     |
| 0x016      | host   | 2-8   | control: uint8 verb, uint8 node (0: all), and what the verb takes, see `Verb`          |
| 0x1E000000 | module | 8     | progress; + node: uint16 step that it makes next, uint16 piece that it wants, both     |
|            |        |       | modulo 65536, uint16 bytes that its buffer has room for, uint8 status, uint8 0         |
| 0x1F000000 | module | 4     | clock; + node: uint32 µs since the motion began, by the module's own clock             |

Positions and increments are in sixteenths of an encoder count, so that a slow feed is not whole counts and nothing
between. A set point of method A is the low 16 bits of the position, so that a lost frame leaves nothing behind.

What a buffer holds is said when it begins: increments (method C; an int16 for each sample period, three in a piece), or
segments (method B; 24 bytes, four pieces), as segments.py packs them, in counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum, IntFlag
from struct import Struct
from typing import NamedTuple

from rds.bus.modules.segments import NodeSegment

SETPOINTS, DATA, CONTROL = 0x014, 0x015, 0x016  # data before a question for them
PROGRESS, CLOCK = 0x1E000000, 0x1F000000  # + node; extended

FINE = 16  # parts of an encoder count
SLOTS = 4  # set points in a frame of method A
PIECE = 6  # bytes of a buffer in one frame of data
BUFFER = 1500  # bytes, as in dcs-thesis; 0.75 s of increments each 1 ms
WRAP = 1 << 16
MOST_INCREMENT = (WRAP // 2 - 1) / FINE  # counts in one step

_SETPOINTS = Struct(f"<{SLOTS}H")
_BEGIN = Struct("<BBBBi")
_GAIN = Struct("<BBBBf")
_PROGRESS = Struct("<HHHBB")
_RATE = 256e6  # a rate is sent in 1/256 ppm, three bytes
_OFFSET = 1e7  # an offset in 0.1 µs, three bytes
_THREE = 1 << 23


class Verb(IntEnum):
    """What a control frame says."""

    BEGIN = 1  # uint8 kind of the buffer, uint8 0, int32 set point: the buffer is empty, and the axis stands there
    GAIN = 2  # uint8 which, uint8 0, float32
    GO = 3  # to all: the first step begins now
    STOP = 4  # zero volts; what the buffer holds is dropped
    INQUIRE = 5  # say your progress
    TIME = 6  # say what your clock showed at this frame
    CORRECT = 7  # int24 rate in 1/256 ppm, int24 offset in 0.1 µs: time of the motion = clock (1 + rate) + offset


class Buffer(IntEnum):
    """What a module's buffer holds."""

    INCREMENTS = 1  # method C
    SEGMENTS = 2  # method B
    NONE = 3  # method A: set points come in each period


class Gain(IntEnum):
    """Of the module's law, see node_motion.py."""

    PROPORTIONAL = 0  # V a count
    VELOCITY = 1  # V/(count/s)
    FORWARD = 2  # V, while the set point moves forward
    BACKWARD = 3  # V, while it moves backward; negative
    INTEGRAL = 4  # V/(count s)


class MotionStatus(IntFlag):
    """What a module says of its motion."""

    NONE = 0
    READY = 1  # it has begun, and stands or moves by set points
    RUNNING = 2  # it follows set points, and takes no other motion
    EMPTY = 4  # its buffer ran empty while it ran
    SILENT = 8  # the host said nothing for a second: zero volts
    FAR = 0x10  # the axis was too far from its set point: zero volts
    EMERGENCY = 0x20  # emergency stop: zero volts until it is reset


class Progress(NamedTuple):
    """How far a module is; `step` and `wanted` modulo 65536."""

    step: int
    wanted: int
    free: int  # bytes
    status: MotionStatus


def encode_setpoints(positions: Sequence[int]) -> bytes:
    """Data of a frame of method A: up to four positions in sixteenths of a count; missing slots get 0."""
    filled = [position % WRAP for position in positions] + [0] * (SLOTS - len(positions))
    return _SETPOINTS.pack(*filled)


def decode_setpoint(data: bytes | bytearray, slot: int, near: float) -> float:
    """The set point in this slot, counts, that is nearest to `near`."""
    low = _SETPOINTS.unpack(data)[slot]
    there = round(near * FINE)
    return float((there + (low - there + WRAP // 2) % WRAP - WRAP // 2) / FINE)


def encode_begin(node: int, kind: Buffer, position: int) -> bytes:
    """Data of BEGIN with a set point in sixteenths of a count."""
    return _BEGIN.pack(Verb.BEGIN, node, kind, 0, position)


def decode_begin(data: bytes | bytearray) -> tuple[Buffer, float]:
    """What the buffer is going to hold, and where the axis stands, counts."""
    _, _, kind, _, position = _BEGIN.unpack(data)
    return Buffer(kind), position / FINE


def encode_gain(node: int, which: Gain, value: float) -> bytes:
    """Data of GAIN."""
    return _GAIN.pack(Verb.GAIN, node, which, 0, value)


def decode_gain(data: bytes | bytearray) -> tuple[Gain, float]:
    """Which gain, and its value."""
    _, _, which, _, value = _GAIN.unpack(data)
    return Gain(which), value


def encode_correction(node: int, rate: float, offset: float) -> bytes:
    """Data of CORRECT: a dimensionless rate, and an offset in s, each limited to what three bytes hold."""
    words = (max(-_THREE, min(_THREE - 1, round(value))) for value in (rate * _RATE, offset * _OFFSET))
    return bytes([Verb.CORRECT, node]) + b"".join(word.to_bytes(3, "little", signed=True) for word in words)


def decode_correction(data: bytes | bytearray) -> tuple[float, float]:
    """Rate, and offset in s."""
    rate, offset = (int.from_bytes(data[i : i + 3], "little", signed=True) for i in (2, 5))
    return rate / _RATE, offset / _OFFSET


def encode_progress(progress: Progress) -> bytes:
    """Data of a module's report."""
    step, wanted, free, status = progress
    return _PROGRESS.pack(step % WRAP, wanted % WRAP, free, status, 0)


def decode_progress(data: bytes | bytearray) -> Progress:
    """What a module reports."""
    step, wanted, free, status, _ = _PROGRESS.unpack(data)
    return Progress(step, wanted, free, MotionStatus(status))


def increments(data: bytes | bytearray) -> list[float]:
    """The increments in a piece, counts."""
    return [int.from_bytes(data[i : i + 2], "little", signed=True) / FINE for i in range(0, len(data) - 1, 2)]


def pieces_of_increments(fine: Sequence[int]) -> list[bytes]:
    """The pieces that carry these increments, in sixteenths of a count, each within ±32767."""
    data = b"".join(int(value).to_bytes(2, "little", signed=True) for value in fine)
    return [data[i : i + PIECE] for i in range(0, len(data), PIECE)]


def pieces_of_segments(segments: Sequence[NodeSegment]) -> list[bytes]:
    """The pieces that carry these segments."""
    data = b"".join(segment.pack() for segment in segments)
    return [data[i : i + PIECE] for i in range(0, len(data), PIECE)]
