"""The cyclic protocol: one frame of 13 bytes for all units in each period (dcs-thesis, section 3.6.1, figure 3.11).

The thesis calls it *bidirectional*, and its units never answer: that is why a host cannot know what they do. Here a
bit of the info byte asks for answers, and another adds a checksum; with neither bit the frame is that of the thesis.

| byte     | content                                                                                       |
| -------- | --------------------------------------------------------------------------------------------- |
| 0        | info: 1, 1, checksum follows, answers wanted, mode (2 bits), number of the frame (2 bits)     |
| 1 to 12  | six commands of two bytes, little-endian, in the order of the machine's axes; set-up: uint32  |
|          | period in µs (0: 10 ms), uint32 session, 4 bytes 0                                            |
| 13       | CRC-8 of bytes 0 to 12, if the info byte says so                                              |

The thesis prints no values of the info byte: these are ours, above all first bytes of the other protocol
(`commands.py`), so that one unit takes both. A command is a voltage in 20/65536 V, or an increment in BLU.

An answer has 7 bytes: unit (4 bits), number of the frame that it answers (2 bits), 1, 1; status; position counts
(int32, little-endian); CRC-8. Unit i of the line begins its answer i answers after the frame, so that none collide.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum, IntFlag
from struct import Struct
from typing import NamedTuple

from rds.core.errors import InputError

SIZE = 13  # bytes
SLOTS = 6  # commands in a frame
UNITS = range(1, 16)  # at most fifteen (section 3.6.2): the four switches of a board, less 0, which is the host's
HIGHEST_VOLTAGE = 10.0  # V; sent as 10 V less one unit
VOLTS_PER_UNIT = 20.0 / 65536.0
NUMBERS = 4  # of frames
FULL = 0.8  # of a period that a frame and its answers may take in a loop
BITS_PER_BYTE = 10  # start bit, eight data bits, stop bit

# First and last bytes are no CAN identifiers: nothing of this dialect can be said on a CAN bus.
IDENTIFIERS: tuple[tuple[int, int, str], ...] = ()

_MARK, _CHECKED, _ANSWERED = 0xC0, 0x20, 0x10
_WORDS = Struct("<6h")
_SETUP = Struct("<II4x")
_ANSWER = Struct("<BBi")
ANSWER_SIZE = _ANSWER.size + 1


class Mode(IntEnum):
    """What the twelve bytes of a frame are."""

    CALL = 0  # nothing: units answer and have zero volts, or stand
    VOLTAGES = 1
    INCREMENTS = 2  # of position, in BLU, to be carried out within the period
    SETUP = 3


class Status(IntFlag):
    """What a unit says about itself."""

    NONE = 0
    MOVING = 1
    MASTER = 2  # it acknowledges the steps of a buffer
    FILLED = 4  # its buffer holds commands
    EXECUTING = 8  # it carries its buffer out
    NOT_SET_UP = 16  # it has been switched on, or reset, since the last set-up
    LIMIT = 32  # at its limit switch
    EMPTY = 64  # its cyclic buffer ran empty: the end, or too slow a host
    WATCHDOG = 128  # no frame came for too long: it stopped by itself


class Info(NamedTuple):
    """The first byte of a frame."""

    mode: Mode
    number: int = 0
    answers: bool = True
    checked: bool = True

    @property
    def size(self) -> int:
        """Bytes of the whole frame."""
        return SIZE + self.checked


class Answer(NamedTuple):
    """What a unit says after a frame."""

    unit: int
    number: int
    status: Status
    counts: int


def crc8(data: bytes | bytearray) -> int:
    """CRC-8 of SMBus: x⁸ + x² + x + 1, from 0. It finds every error of up to three bits in a frame."""
    crc = 0
    for byte in data:
        crc = _CRC[crc ^ byte]
    return crc


def _crc_table() -> bytes:
    table = bytearray()
    for value in range(256):
        for _ in range(8):
            value = (value << 1 ^ 0x07) & 0xFF if value & 0x80 else value << 1
        table.append(value)
    return bytes(table)


_CRC = _crc_table()


def decode_info(byte: int) -> Info | None:
    """What a frame's first byte says; None if no frame begins with it."""
    if byte & _MARK != _MARK:
        return None
    return Info(Mode(byte >> 2 & 3), byte & 3, bool(byte & _ANSWERED), bool(byte & _CHECKED))


def encode(info: Info, body: bytes) -> bytes:
    """A whole frame; `body` has 12 bytes."""
    first = _MARK | _CHECKED * info.checked | _ANSWERED * info.answers | info.mode << 2 | info.number % NUMBERS
    frame = bytes([first]) + body
    return frame + bytes([crc8(frame)]) if info.checked else frame


def decode(frame: bytes | bytearray) -> tuple[Info, bytes] | None:
    """Info and the 12 bytes of a whole frame; None where length or checksum are wrong."""
    info = decode_info(frame[0]) if frame else None
    if info is None or len(frame) != info.size or (info.checked and crc8(frame[:SIZE]) != frame[SIZE]):
        return None
    return info, bytes(frame[1:SIZE])


def voltage_words(voltages: Sequence[float]) -> bytes:
    """Up to six voltages in V as the body of a frame; missing slots get 0 V. InputError outside ±10 V."""
    for slot, voltage in enumerate(voltages):
        if not -HIGHEST_VOLTAGE <= voltage <= HIGHEST_VOLTAGE:  # false for NaN too
            raise InputError(f"voltage {voltage!r} V of slot {slot} must be from -10 to 10 V; limit it before")
    return words([min(round(voltage / VOLTS_PER_UNIT), 32767) for voltage in voltages])


def words(values: Sequence[int]) -> bytes:
    """Up to six commands as the body of a frame. InputError for more, or for one that two bytes cannot hold."""
    if len(values) > SLOTS:
        raise InputError(f"{len(values)} commands; one frame carries {SLOTS}")
    for slot, value in enumerate(values):
        if not -32768 <= value <= 32767:
            raise InputError(f"command {value} of slot {slot} must be from -32768 to 32767")
    return _WORDS.pack(*values, *[0] * (SLOTS - len(values)))


def decode_words(body: bytes) -> tuple[int, ...]:
    """The six commands of a body."""
    return _WORDS.unpack(body)


def setup_body(period: float, session: int) -> bytes:
    """The body of a set-up: sample period in s, and a number that stands for this host's run."""
    return _SETUP.pack(round(period * 1e6), session)


def decode_setup(body: bytes) -> tuple[float, int]:
    """Period in s and session of a set-up."""
    microseconds, session = _SETUP.unpack(body)
    return microseconds * 1e-6, session


def encode_answer(answer: Answer) -> bytes:
    """The seven bytes of an answer; the position wraps round as a 32-bit counter does."""
    counts = (answer.counts + 0x80000000) % 0x100000000 - 0x80000000
    data = _ANSWER.pack(_MARK | answer.number % NUMBERS << 4 | answer.unit, answer.status, counts)
    return data + bytes([crc8(data)])


def decode_answer(data: bytes | bytearray) -> Answer | None:
    """What a unit says; None if these are not the seven bytes of an answer."""
    if len(data) != ANSWER_SIZE or data[0] & _MARK != _MARK or crc8(data[:-1]) != data[-1]:
        return None
    head, status, counts = _ANSWER.unpack(data[:-1])
    return Answer(head & 15, head >> 4 & 3, Status(status), counts)


def byte_time(baud: float) -> float:
    """s that a byte takes on the wire: start bit, eight data bits, stop bit."""
    return BITS_PER_BYTE / baud
