"""The addressed protocol: commands of two bytes, and buffers (dcs-thesis, section 3.6.2, table 3.3, appendix B).

The thesis calls it *unidirectional*, although it is the one in which units answer.

| command    | meaning                                                                                        |
| ---------- | ---------------------------------------------------------------------------------------------- |
| UID "0"    | select: the unit answers UID, takes 1500 bytes, answers UID again                              |
| UID UID    | the same, and this unit is the master of the steps: it acknowledges each one                   |
| "j" UID    | jog: the unit answers UID; UID and a position byte follow; it moves until the next byte        |
| "s" UID    | stop this unit; "s" "s" stops all                                                              |
| "h" UID    | go home: the unit answers UID when it is at its limit switch                                   |
| "r" "r"    | reset the system                                                                               |
| HOST 0     | carry the buffers out: each byte that follows makes one step; the master answers its UID       |

The firmware's identifier is 120 + switches, and the host's is 120: units 1 to 15 are 121 to 135. (The table's "0" is a
character; the host program of appendix D sends 0. Both select, and so does any byte but the UID.)

A position byte is a direction (bit 7: backward) and 0 to 127 BLU, to be moved in 10 ms.

What we add, to close the gaps:

| command   | meaning                                                                                         |
| --------- | ----------------------------------------------------------------------------------------------- |
| 0x15 UID  | inquiry (method B's pseudo-code asks for a position): the unit answers nine bytes, see `Report` |
| 0x26 UID  | data for the cyclic buffer: uint16 index of the first, count, bytes, CRC-16; answer: report     |
| 0x4D UID  | data of a segment (method B): uint16 index, count, bytes, CRC-16; answer: report                |
| 0x1E HOST | go: all units carry their cyclic buffers or segments out, by their own clocks                   |
| 0x2B byte | the clock: the step that begins now, its lowest eight bits; units correct theirs by it          |

Data have a CRC-16 (CCITT, uint16), as up to 260 bytes are too many for a CRC-8: of pieces that noise has damaged one of
400 would pass it.
"""

from __future__ import annotations

from binascii import crc_hqx
from struct import Struct
from typing import NamedTuple

from rds.bus.modules.dcs.frames import UNITS, Status, crc8
from rds.core.errors import InputError

HOST = 120
SELECT = ord("0")
JOG, STOP, HOME, RESET = (ord(letter) for letter in "jshr")
# two bits at least from every other first byte, so that no single wrong bit makes one of them another ("s" and "r", "j"
# and "h" of the thesis are one bit apart)
INQUIRY, DATA, SEGMENT, GO, CLOCK = 0x15, 0x26, 0x4D, 0x1E, 0x2B
BUFFER = 1500  # bytes
BACKWARD = 0x80
MOST_STEPS = 127  # BLU in one position byte
BYTE_TIME = 0.01  # s in which the firmware carries a position byte out (appendix C: 2 c half periods of 5000/c µs)
HOST_TIME = 0.1  # s that the host program of appendix D reckons with
TURN_ROUND = 250e-6  # s that the firmware leaves its transmitter on
DATA_HEAD = Struct("<HB")
MOST_DATA = 255  # bytes in one piece of data
_CHECKSUM = Struct("<H")
_REPORT = Struct("<BBiH")
REPORT_SIZE = _REPORT.size + 1


class Report(NamedTuple):
    """What a unit answers to an inquiry, and to data: nine bytes with their CRC-8.

    `step` is the one that it carries out next, modulo 65536; to data, the number of the byte that it wants next; while
    1500 bytes wait in its buffer, their CRC-16 (CCITT).
    """

    unit: int
    status: Status
    counts: int
    step: int


def uid(unit: int) -> int:
    """The identifier of a unit, 121 to 135. InputError for a number that no unit can have."""
    if unit not in UNITS:
        raise InputError(
            f"unit {unit!r} must be from {UNITS[0]} to {UNITS[-1]}: a serial line has at most {len(UNITS)} units"
        )
    return HOST + unit


def position_byte(steps: int) -> int:
    """A step of `steps` BLU (-127 to 127) as a byte. InputError for more."""
    if not -MOST_STEPS <= steps <= MOST_STEPS:
        raise InputError(
            f"{steps} BLU in one step; a position byte holds {MOST_STEPS} at most: lower the feed or lengthen the step"
        )
    return -steps | BACKWARD if steps < 0 else steps


def steps_of(byte: int) -> int:
    """The BLU of a position byte; 0x80 is no motion, backward."""
    return -(byte & MOST_STEPS) if byte & BACKWARD else byte


def encode_report(report: Report) -> bytes:
    """The nine bytes of a report."""
    counts = (report.counts + 0x80000000) % 0x100000000 - 0x80000000
    data = _REPORT.pack(uid(report.unit), report.status, counts, report.step & 0xFFFF)
    return data + bytes([crc8(data)])


def decode_report(data: bytes | bytearray) -> Report | None:
    """What a unit reports; None if these are not the nine bytes of a report."""
    if len(data) != REPORT_SIZE or crc8(data[:-1]) != data[-1]:
        return None
    identifier, status, counts, step = _REPORT.unpack(data[:-1])
    return Report(identifier - HOST, Status(status), counts, step)


def encode_data(command: int, unit: int, index: int, data: bytes) -> bytes:
    """A piece of data for a unit's cyclic buffer (`DATA`) or its segments (`SEGMENT`), with its CRC-16."""
    if not 1 <= len(data) <= MOST_DATA:
        raise InputError(f"{len(data)} bytes of data; one piece has 1 to {MOST_DATA}")
    body = bytes([command, uid(unit)]) + DATA_HEAD.pack(index & 0xFFFF, len(data)) + data
    return body + _CHECKSUM.pack(crc_hqx(body, 0))


def is_whole(data: bytes | bytearray) -> bool:
    """Whether a piece of data has come as it was sent."""
    body, checksum = data[: -_CHECKSUM.size], data[-_CHECKSUM.size :]
    return _CHECKSUM.pack(crc_hqx(body, 0)) == checksum


def data_size(count: int) -> int:
    """Bytes of a piece of data on the wire."""
    return 2 + DATA_HEAD.size + count + _CHECKSUM.size
