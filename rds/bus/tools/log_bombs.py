"""Bus logs that are made to fill the memory, or never to end: found before their readers see them."""

from __future__ import annotations

import mmap
import re
import sqlite3
import struct
import zlib
from pathlib import Path

from rds.core.errors import InputError
from rds.core.limits import allow_unpacked, most_unpacked

_BLOCK = struct.Struct("<4s4xQQ2sBxIQQ")  # of DZ: id, length, links; type packed, how, parameter, size, packed size
_DEFLATE = (0, 1)  # how: deflate, or transposed before
_PIECE = 1 << 20  # bytes


def check_table(path: Path) -> None:
    """InputError where `messages` of an SQLite log is no plain table: a view has rows and bytes that no file holds."""
    try:
        file = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
        try:
            found = file.execute("SELECT type, sql FROM sqlite_master WHERE name = 'messages'").fetchone()
            computed = [column for column in file.execute("PRAGMA table_xinfo(messages)") if column[6]]
        finally:
            file.close()
    except sqlite3.Error as error:
        raise InputError(f"it can't be read as .db: {error}; record it again, or use another log", str(path)) from error
    if found and (found[0] != "table" or computed or not re.match(r"CREATE\s+TABLE\b", str(found[1]), re.IGNORECASE)):
        raise InputError(
            "its frames are computed, by a view or in a column, and may never end; use a log that is a plain table",
            str(path),
        )


def check_mf4(path: Path) -> None:
    """InputError where the packed blocks of an MDF 4 file (ASAM MDF 4.1, DZ) unpack to more than is read of it."""
    size = path.stat().st_size
    if not size:
        return
    most, total = most_unpacked(size), 0.0
    with open(path, "rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
        at = content.find(b"##DZ")
        while at >= 0 and at + _BLOCK.size <= size and total <= most:
            _, _, _, _, how, _, announced, packed = _BLOCK.unpack_from(content, at)
            begin = at + _BLOCK.size
            if how in _DEFLATE:
                total += _count(content, begin, min(begin + packed, size), most - total)
            else:
                total += announced
            at = content.find(b"##DZ", begin)
    allow_unpacked(total, size, path, counting=True)


def _count(content: mmap.mmap, begin: int, end: int, most: float) -> int:
    """Bytes in a zlib stream, counted in pieces up to a little more than `most`; a damaged one up to the damage."""
    inflate, total = zlib.decompressobj(), 0
    try:
        while begin < end and total <= most and not inflate.eof:
            packed = content[begin : min(begin + _PIECE, end)]
            begin += len(packed)
            while packed and total <= most:
                total += len(inflate.decompress(packed, _PIECE))
                packed = inflate.unconsumed_tail
    except zlib.error:
        pass
    return total
