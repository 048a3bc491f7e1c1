"""The bits of a CAN frame one by one, as they follow each other on the wire: for a viewer and for injected errors.

`bits.py` only counts them, fast; here they are spelled out, with fields, stuff bits and check sums. Dominant is 0.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from rds.bus.medium.bits import CRC15, CRC17, CRC21, ERROR_DELIMITER, ERROR_FLAG, INTERFRAME, Bits, header
from rds.core.errors import InputError

_STANDARD = (("start", 1), ("identifier", 11), ("rtr", 1), ("ide", 1), ("fdf", 1), ("dlc", 4))
_EXTENDED = (
    *(("start", 1), ("identifier", 11), ("srr", 1), ("ide", 1), ("extension", 18)),
    *(("rtr", 1), ("fdf", 1), ("reserved", 1), ("dlc", 4)),
)
_FD_END = (("fdf", 1), ("reserved", 1), ("brs", 1), ("esi", 1), ("dlc", 4))
_STANDARD_FD = (("start", 1), ("identifier", 11), ("rrs", 1), ("ide", 1), *_FD_END)
_EXTENDED_FD = (*_EXTENDED[:5], ("rrs", 1), *_FD_END)


class Field(NamedTuple):
    """A field of a frame; `start` and `stop` are positions in the bits on the wire, stuff bits within it included."""

    name: str
    start: int
    stop: int
    value: int  # without stuff bits


class BitString(NamedTuple):
    """A frame on the wire."""

    bits: str  # "0" dominant, "1" recessive, from the start bit to the end of frame
    stuffed: tuple[int, ...]  # positions of stuff bits, dynamic and fixed
    fields: tuple[Field, ...]
    fast: range  # positions of the bits at the data's bit rate; the first lies after BRS, the last is the delimiter

    def field(self, name: str) -> Field:
        """The field called `name`; InputError names those there are."""
        for field in self.fields:
            if field.name == name:
                return field
        raise InputError(f"the frame has no field {name!r}; it has {', '.join(field.name for field in self.fields)}")

    def measure(self) -> Bits:
        """How many bits there are of either rate."""
        return Bits(len(self.bits) - len(self.fast), len(self.fast))

    def broken_off(self, position: int, others: int = 0) -> str:
        """What is on the wire if an active error is found at bit `position`: up to there, error frame, intermission.

        `others` (0 to 6): bits by which the flags of other nodes outlast the first. The flag begins with the bit
        after the faulty one.
        """
        if not 0 <= position < len(self.bits):
            raise InputError(f"bit {position!r} is not in the frame, which has {len(self.bits)} bits")
        if not 0 <= others <= ERROR_FLAG:
            raise InputError(f"other flags outlast the first by 0 to {ERROR_FLAG} bits, not by {others!r}")
        return self.bits[: position + 1] + "0" * (ERROR_FLAG + others) + "1" * (ERROR_DELIMITER + INTERFRAME)


def bit_string(identifier: int, data: bytes | bytearray = b"", acknowledged: bool = True, **flags: Any) -> BitString:
    """The bits of a frame; `flags` as for `bits.frame_bits`. InputError for a frame that can't exist.

    `acknowledged`: another node has made the ACK slot dominant.
    """
    head, length = header(identifier, len(data), **flags)
    fd, extended = bool(flags.get("fd")), bool(flags.get("extended"))
    layout = (_EXTENDED_FD if extended else _STANDARD_FD) if fd else (_EXTENDED if extended else _STANDARD)
    plain = f"{head:0{length}b}" + "".join(f"{byte:08b}" for byte in data)
    fields = [*layout, *((f"data {number}", 8) for number in range(len(data)))]
    writer = _Writer()
    if fd:
        writer.stuffed(plain, fields, last=False)
        _fd_checks(writer, len(data))
    else:
        checked = plain + f"{crc(plain, CRC15, 15):015b}"
        writer.stuffed(checked, [*fields, ("crc", 15)], last=True)
    begin = writer.fields[[name for name, _ in layout].index("esi")].start if flags.get("bitrate_switch") else None
    writer.plain("delimiter", "1")
    fast = range(0) if begin is None else range(begin, len(writer.bits))
    for name, bits in (("ack", "0" if acknowledged else "1"), ("ack delimiter", "1"), ("end", "1" * 7)):
        writer.plain(name, bits)
    return BitString("".join(writer.bits), tuple(writer.positions), tuple(writer.fields), fast)


def crc(bits: str, generator: int, width: int, start: int = 0) -> int:
    """Remainder of the bits times x^width divided by the generator (without its leading term)."""
    remainder, top, mask = start, 1 << (width - 1), (1 << width) - 1
    for bit in bits:
        carry = (remainder & top != 0) != (bit == "1")
        remainder = (remainder << 1 & mask) ^ (generator if carry else 0)
    return remainder


def _fd_checks(writer: _Writer, size: int) -> None:
    """Stuff count and CRC of an FD frame: the CRC covers dynamic stuff bits, and starts with its highest bit set."""
    count = len(writer.positions) % 8
    gray = count ^ count >> 1
    stuff_count = f"{gray:03b}{gray.bit_count() % 2}"
    generator, width = (CRC17, 17) if size <= 16 else (CRC21, 21)
    check = crc("".join(writer.bits) + stuff_count, generator, width, 1 << (width - 1))
    writer.spaced((("stuff count", stuff_count), ("crc", f"{check:0{width}b}")))


class _Writer:
    """The frame as far as it is written."""

    def __init__(self) -> None:
        self.bits: list[str] = []
        self.positions: list[int] = []
        self.fields: list[Field] = []

    def plain(self, name: str, bits: str) -> None:
        self.fields.append(Field(name, len(self.bits), len(self.bits) + len(bits), int(bits, 2)))
        self.bits += bits

    def stuffed(self, bits: str, fields: list[tuple[str, int]], last: bool) -> None:
        """Fields with dynamic stuff bits; `last`: one may follow the last bit."""
        run, left = 0, len(bits)
        stream = iter(bits)
        for name, width in fields:
            start, value = len(self.bits), 0
            for bit in (next(stream) for _ in range(width)):
                run = run + 1 if self.bits and bit == self.bits[-1] else 1
                self.bits.append(bit)
                value = value << 1 | (bit == "1")
                left -= 1
                if run == 5 and (left or last):
                    self._stuff()
                    run = 1
            self.fields.append(Field(name, start, len(self.bits), value))

    def spaced(self, fields: tuple[tuple[str, str], ...]) -> None:
        """Fields with a fixed stuff bit before the first bit and each fourth one after it."""
        written = 0
        for name, bits in fields:
            start = len(self.bits)
            for bit in bits:
                if written % 4 == 0:
                    self._stuff()
                self.bits.append(bit)
                written += 1
            if written % 4 == 0 and name == fields[-1][0]:
                self._stuff()
            self.fields.append(Field(name, start, len(self.bits), int(bits, 2)))

    def _stuff(self) -> None:
        self.positions.append(len(self.bits))
        self.bits.append("0" if self.bits[-1] == "1" else "1")
