"""Single words in memory that processes share: read and written whole.

`struct.pack_into` clears the place before it fills it, byte by byte, and `unpack_from` reads so: another process may
see zero, or half of a number. Eight bytes copied as one slice go in one instruction.
"""

from __future__ import annotations

import mmap
import struct

_F64 = struct.Struct("<d")


def read_word(memory: mmap.mmap, at: int) -> int:
    """The unsigned whole number of 64 bits at `at`."""
    return int.from_bytes(memory[at : at + 8], "little")


def write_word(memory: mmap.mmap, at: int, value: int) -> None:
    """Write it."""
    memory[at : at + 8] = value.to_bytes(8, "little")


def write_float(memory: mmap.mmap, at: int, value: float) -> None:
    """Write a float64 at `at`, which `struct` may read as "<d"."""
    memory[at : at + 8] = _F64.pack(value)
