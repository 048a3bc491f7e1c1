"""Where the fast lane's compiled code is kept, and the shared library that it is where the computer has a linker."""

from __future__ import annotations

import ctypes
import os
import sys
import zlib
from functools import cache

ENTRIES = ("rds_read_lines", "rds_write_rows")
SOURCES = (
    "fast_lane_cycles.py",
    "fast_lane_files.py",
    "fast_lane_kernel.py",
    "fast_lane_native.py",
    "fast_lane_object.py",
    "fast_lane_rows.py",
    "fast_lane_text.py",
    "fast_lane_words.py",
    "arcs.py",
    "batch.py",
    "call_text.py",
    "canon.py",
    "cycles.py",
    "source.py",
    "state.py",
)
FOLDER = os.path.join(os.path.dirname(__file__), "__pycache__")
_DIGEST = 4  # bytes
IS_TRIED = sys.platform == "linux"  # elsewhere Python reads and writes the same, slower


def library() -> ctypes.CDLL | None:
    """The shared library, if it has been made before and is whole."""
    if not IS_TRIED:
        return None
    try:
        place = file_of("so")
        whole(place)
        return ctypes.CDLL(place)
    except (OSError, ValueError):
        return None


def file_of(what: str) -> str:
    """Where compiled code of the present sources lies, or is to lie."""
    return os.path.join(FOLDER, f"{family()}.{_sources()}.{what}")


def family() -> str:
    """How the names of all files begin that this Python makes for processors of this kind."""
    return f"fast_lane.{sys.implementation.cache_tag}-{os.uname().machine}"


def whole(place: str) -> bytes:
    """The file before its digest; ValueError if it is damaged, which might end the process when it is loaded."""
    with open(place, "rb") as stream:
        content = stream.read()
    if digest(content[:-_DIGEST]) != content[-_DIGEST:]:
        raise ValueError("the file is damaged")
    return content[:-_DIGEST]


def digest(content: bytes) -> bytes:
    return zlib.crc32(content).to_bytes(_DIGEST, "little")


@cache
def _sources() -> str:
    """Of the text that it was compiled from."""
    found = 0
    for name in SOURCES:
        with open(os.path.join(os.path.dirname(__file__), name), "rb") as stream:
            found = zlib.crc32(stream.read(), found)
    return f"{found:08x}"
