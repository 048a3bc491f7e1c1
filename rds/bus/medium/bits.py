"""How many bits a CAN frame has on the wire, and how long it takes: exact, from its content.

A classic frame is stuffed from its start bit to the last bit of its CRC-15: after five equal bits a complementary one
follows, which itself begins the next run. A CAN FD frame is stuffed so to the last bit of its data; its CRC field has
a fixed stuff bit before the stuff count and after every fourth bit, so its length needs no CRC. With the bit-rate
switch an FD frame runs faster from the sample point of its BRS bit to that of its CRC delimiter. Wherever these sample
points are, both bits together last one bit of either rate: BRS counts as the slow one, the delimiter as the fast one.

Sources: ISO 11898-1:2015, 10.4 and 10.5; Bosch, "CAN Specification 2.0" (1991); bounds: Davis, Burns, Bril, Lukkien,
"Controller Area Network (CAN) schedulability analysis: Refuted, revisited and revised", Real-Time Systems 35 (2007),
equations (1) to (3).

Frames are described as everywhere in this package: `identifier`, `data`, `extended` (29 bits), `remote` (no data; the
length asked for is `dlc`), `fd`, `bitrate_switch`, `error_state` (the sender is error passive).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rds.core.errors import InputError

INTERFRAME = 3  # bits of intermission: recessive bits after a frame before the next may start
CRC15, CRC17, CRC21 = 0x4599, 0x1685B, 0x102899  # generators without their leading term
FD_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)  # bytes, by DLC
END = 10  # bits: ACK slot, ACK delimiter, end of frame (7) and, before them, the CRC delimiter

ERROR_FLAG = 6  # bits, and up to 6 more where other nodes' flags follow
ERROR_DELIMITER = 8
SUSPEND = 8  # bits that an error-passive sender waits beyond the interframe space
SHORTEST_ERROR = ERROR_FLAG + ERROR_DELIMITER + INTERFRAME  # 17 bits until the bus is free again
LONGEST_ERROR = SHORTEST_ERROR + 6 + SUSPEND  # 31

SECOND = 1_000_000_000  # ns
_STANDARD, _EXTENDED = 0x7FF, 0x1FFFFFFF
_DLC = {size: dlc for dlc, size in enumerate(FD_SIZES)}


class Bits(NamedTuple):
    """Bits of one frame from its start bit to the end of its end-of-frame field, without the interframe space."""

    nominal: int  # at the arbitration's bit rate
    fast: int = 0  # at the data's bit rate

    @property
    def total(self) -> int:
        """Bits at either rate."""
        return self.nominal + self.fast

    def time(self, bitrate: int, data_bitrate: int | None = None, interframe: bool = False) -> int:
        """Duration in ns, rounded up; rates in bit/s. `data_bitrate` None: the same rate."""
        nominal = self.nominal + (INTERFRAME if interframe else 0)
        if not self.fast or data_bitrate is None:
            return -(-(nominal + self.fast) * SECOND // bitrate)
        return -(-(nominal * data_bitrate + self.fast * bitrate) * SECOND // (bitrate * data_bitrate))


def frame_bits(
    identifier: int,
    data: bytes | bytearray = b"",
    extended: bool = False,
    remote: bool = False,
    fd: bool = False,
    bitrate_switch: bool = False,
    error_state: bool = False,
    dlc: int | None = None,
) -> Bits:
    """The exact bits of a frame. InputError for a frame that can't exist; its text says why."""
    head, length = header(identifier, len(data), extended, remote, fd, bitrate_switch, error_state, dlc)
    size = 8 * len(data)
    length += size
    value = head << size | int.from_bytes(data, "big")
    if fd:
        return _fd_bits(value, length, len(data), 36 if extended else 17, bitrate_switch)
    crc = 0
    for table, byte in zip(_CRC15_TABLES, value.to_bytes(16, "little"), strict=False):
        crc ^= table[byte]
    length += 15
    return Bits(length + _stuff_bits(value << 15 | crc, length)[0] + END)


def frame_time(
    identifier: int,
    data: bytes | bytearray = b"",
    *,
    bitrate: int,
    data_bitrate: int | None = None,
    interframe: bool = False,
    **flags: Any,
) -> int:
    """How long a frame takes, ns; `flags` as for `frame_bits`, rates in bit/s.

    `interframe` adds the three bits after which the next frame may start.
    """
    return frame_bits(identifier, data, **flags).time(bitrate, data_bitrate, interframe)


def shortest(size: int, extended: bool = False) -> int:
    """Bits of a classic frame with `size` bytes without any stuff bit, with interframe space: 47+8n or 67+8n."""
    return least_bits(size, extended).nominal + INTERFRAME


def longest(size: int, extended: bool = False) -> int:
    """Most bits of a classic frame with `size` bytes of whatever content, with interframe space: 55+10n or 80+10n."""
    return most_bits(size, extended).nominal + INTERFRAME


def least_bits(size: int, extended: bool = False, fd: bool = False, bitrate_switch: bool = False) -> Bits:
    """Bits of a frame with `size` bytes and no dynamic stuff bit."""
    slow, length, after = _regions(size, extended, fd)
    if fd and bitrate_switch:
        return Bits(slow + END - 1, length - slow + after + 1)
    return Bits(length + after + END)


def most_bits(size: int, extended: bool = False, fd: bool = False, bitrate_switch: bool = False) -> Bits:
    """Bound of the bits of a frame with `size` bytes: a stuff bit after the fifth bit and every fourth one then.

    That many can be had by no content of some sizes, for the control bits and the CRC are not free.
    """
    slow, length, after = _regions(size, extended, fd)
    # in an FD frame a fixed stuff bit takes the place of the one that would follow the data's last bit
    stuffed = (length - (2 if fd else 1)) // 4
    if fd and bitrate_switch:
        # all that can be at the slow rate are: the bound then holds for any pair of rates with a faster second
        early = (slow - 2) // 4
        return Bits(slow + early + END - 1, length - slow + stuffed - early + after + 1)
    return Bits(length + stuffed + after + END)


def error_frame(others: int = 0) -> int:
    """Bits of an error or overload frame: flag and delimiter, 14 to 20, without interframe space.

    `others`: bits (0 to 6) by which the other nodes' flags outlast the first.
    """
    if not 0 <= others <= ERROR_FLAG:
        raise InputError(f"other flags outlast the first by 0 to {ERROR_FLAG} bits, not by {others!r}")
    return ERROR_FLAG + others + ERROR_DELIMITER


def header(
    identifier: int,
    size: int,
    extended: bool = False,
    remote: bool = False,
    fd: bool = False,
    bitrate_switch: bool = False,
    error_state: bool = False,
    dlc: int | None = None,
) -> tuple[int, int]:
    """The bits before the data as a number, first bit highest, and how many they are. InputError as `frame_bits`."""
    if not 0 <= identifier <= (_EXTENDED if extended else _STANDARD):
        raise InputError(f"identifier {identifier:#x} must be from 0 to {_EXTENDED if extended else _STANDARD:#x}")
    if fd:
        code = _DLC.get(size)
        if code is None or remote or dlc not in (None, size, code):
            raise _no_fd_frame(size, remote, dlc)
        # FDF 1, reserved 0, BRS, ESI, DLC
        control = 0x80 | bitrate_switch << 5 | error_state << 4 | code
        # SRR and IDE of an extended frame are recessive; RRS and a standard frame's IDE are dominant
        if extended:
            return (identifier >> 18 << 20 | 3 << 18 | identifier & 0x3FFFF) << 9 | control, 41
        return identifier << 10 | control, 22
    code = size if dlc is None else dlc
    if size > 8 or not 0 <= code <= 15 or bitrate_switch or error_state or (size if remote else size != min(code, 8)):
        raise _no_classic_frame(size, code, remote, bitrate_switch or error_state)
    if extended:
        return (identifier >> 18 << 20 | 3 << 18 | identifier & 0x3FFFF) << 7 | remote << 6 | code, 39
    return identifier << 7 | remote << 6 | code, 19


def _fd_bits(value: int, length: int, size: int, slow: int, switch: bool) -> Bits:
    stuffed, last = _stuff_bits(value, length)
    if last:  # instead of this one comes the fixed stuff bit of the CRC field
        stuffed -= 1
    after = crc_field(size)
    if not switch:
        return Bits(length + stuffed + after + END)
    early = _stuff_bits(value >> (length - slow), slow)[0]
    return Bits(slow + early + END - 1, length - slow + stuffed - early + after + 1)


def crc_field(size: int) -> int:
    """Bits of an FD frame's CRC field before its delimiter: stuff count 4, CRC 17 or 21, fixed stuff bits 6 or 7."""
    return 27 if size <= 16 else 32


def _regions(size: int, extended: bool, fd: bool) -> tuple[int, int, int]:
    """Bits before the rate may switch, bits in all under dynamic stuffing, bits between them and the CRC delimiter."""
    if size not in (FD_SIZES if fd else range(9)):
        raise _no_fd_frame(size, False, None) if fd else _no_classic_frame(size, size, False)
    if fd:
        return (36, 41 + 8 * size, crc_field(size)) if extended else (17, 22 + 8 * size, crc_field(size))
    length = (54 if extended else 34) + 8 * size
    return length, length, 0


def _no_fd_frame(size: int, remote: bool, dlc: int | None) -> InputError:
    if remote:
        return InputError("there are no remote frames in CAN FD; send a classic one")
    if size not in _DLC:
        return InputError(f"{size!r} bytes are no size of a CAN FD frame; sizes are {', '.join(map(str, FD_SIZES))}")
    return InputError(f"dlc {dlc!r} does not belong to {size} bytes; leave it out")


def _no_classic_frame(size: int, dlc: int, remote: bool, fast: bool = False) -> InputError:
    if fast:
        return InputError("bit-rate switch and error state exist in CAN FD frames only; set fd")
    if remote and size:
        return InputError(f"a remote frame carries no data, this one has {size} bytes; ask for a length by dlc")
    return InputError(f"{size!r} bytes with dlc {dlc!r} are no classic CAN frame, which carries 0 to 8 bytes")


# --- tables: a byte a step

_Stuffing = list[Any]  # of 256: (stuff bits within the byte, the table to go on with)


def _stuff_bits(value: int, length: int) -> tuple[int, bool]:
    """Stuff bits of the `length` bits of `value`, whose first is a dominant start bit; whether one follows the last."""
    padded = value | (0x55 & 0xFF >> (length & 7)) << length  # alternating bits, recessive at last, fill a first byte
    stuffed = 0
    table = _FIRST
    for byte in padded.to_bytes((length >> 3) + 1, "big"):
        more, table = table[byte]
        stuffed += more
    return stuffed, table is _STUFFED_0 or table is _STUFFED_1


def _stuffing_tables() -> list[_Stuffing]:
    """One table for each state of the stuffing: last bit, its run of 1 to 4, or a stuff bit that was just put in."""
    states = [(bit, run) for bit in (0, 1) for run in (1, 2, 3, 4, 0)]

    def step(state: tuple[int, int], bit: int) -> tuple[int, tuple[int, int]]:
        last, run = state
        if bit != last:
            return 0, (bit, 1)
        run = max(run, 1) + 1
        return (1, (1 - bit, 0)) if run == 5 else (0, (bit, run))

    wide = {(state, bit): step(state, bit) for state in states for bit in (0, 1)}
    for width in (1, 2, 4):  # two steps of so many bits in one
        narrow, wide = wide, {}
        for state in states:
            for first in range(1 << width):
                count, middle = narrow[state, first]
                for second in range(1 << width):
                    more, end = narrow[middle, second]
                    wide[state, first << width | second] = count + more, end
    tables: dict[tuple[int, int], _Stuffing] = {state: [] for state in states}
    for (state, _), (count, end) in wide.items():
        tables[state].append((count, tables[end]))
    return list(tables.values())


def _crc15_tables() -> list[list[int]]:
    """For each byte of a frame, the last one first, what it adds to the CRC: the CRC is linear in the frame's bits."""
    tables = []
    power = CRC15  # remainder of x^15
    for _ in range(13):
        table = [0]
        for _ in range(8):
            table += [entry ^ power for entry in table]
            power = power << 1 ^ ((0x8000 | CRC15) if power & 0x4000 else 0)
        tables.append(table)
    return tables


_CRC15_TABLES = tuple(_crc15_tables())
_, _, _, _, _STUFFED_0, _FIRST, _, _, _, _STUFFED_1 = _stuffing_tables()  # _FIRST: one recessive bit
