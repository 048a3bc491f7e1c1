"""The fast lane's kernels as machine code from an object file, which numba has compiled once.

Importing numba and having it look through what it has kept takes longer than 100,000 lines of a program; an object file
is loaded by llvmlite alone, in a tenth of that. It lies with Python's own compiled files, and is made anew whenever
anything that went into it has changed. Importing this needs llvmlite, which comes with numba.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import sys
from array import array
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from llvmlite import __version__ as llvmlite_version
from llvmlite import binding as llvm

from rds.core.private_files import make_folder, open_private
from rds.nc.language.fast_lane_target import ENTRIES, target_machine
from rds.nc.language.motion_rows import Columns, empty

_SOURCES = (
    "fast_lane_kernel.py",
    "fast_lane_object.py",
    "fast_lane_target.py",
    "fast_lane_text.py",
    "arcs.py",
    "canon.py",
    "state.py",
)
_DIGEST = hashlib.sha256().digest_size
_OUT = 1 << 20  # bytes of text at once
_IS_TRIED = sys.platform == "linux"  # elsewhere Python reads and writes the same, slower
_POINTER = ctypes.c_void_p


class Kernels:
    """The kernels, ready to be called."""

    def __init__(self, objects: dict[str, bytes]):
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
        for object_file in objects.values():
            self._engine.add_object_file(llvm.ObjectFileRef.from_data(object_file))
        self._engine.finalize_object()
        read, write = (self._engine.get_function_address(name) for name in ENTRIES)
        whole = ctypes.c_int64
        # numba's convention: the result and what an exception would be (neither is used), then the arguments
        head = (ctypes.c_int32, _POINTER, _POINTER)
        self._read = ctypes.CFUNCTYPE(*head, _POINTER, whole, whole, whole, *([_POINTER] * 8), whole, _POINTER)(read)
        self._write = ctypes.CFUNCTYPE(*head, whole, *([_POINTER] * 4), whole, _POINTER, whole, _POINTER)(write)
        self._answer, self._unused = _counts(4), _counts(2)
        self._out: ctypes.Array[ctypes.c_char] | None = None

    def reader(self, state: array[float], modes: array[int], rows: int) -> LineReader:
        return LineReader(self._read, state, modes, rows)

    def written(self, columns: Columns, number: int) -> Iterator[tuple[int, str]]:
        """The text of rows, numbered from `number`, in portions: rows of it and their lines.

        A portion without text is a row that Python is to write.
        """
        if self._out is None:
            self._out = ctypes.create_string_buffer(_OUT)
        rows, used = len(columns.kinds), (columns.kinds, columns.digits, columns.ns, columns.values)
        strides = [column.itemsize * (len(column) // rows) for column in used]
        starts = [_address(column) for column in used]
        unused, answer, out = _address(self._unused), _address(self._answer), ctypes.addressof(self._out)
        first = 0
        while first < rows:
            places = [start + first * stride for start, stride in zip(starts, strides, strict=True)]
            self._write(unused, unused + 8, number + first, *places, rows - first, out, _OUT, answer)
            count, size = self._answer[:2]
            yield (count, ctypes.string_at(out, size).decode("ascii")) if count else (1, "")
            first += count or 1


class LineReader:
    """The reader of plain lines for one run, with room for so many rows."""

    def __init__(self, read: Any, state: array[float], modes: array[int], rows: int):
        self._read, self._room = read, rows
        self._columns = empty(rows)
        self._kept = (state, modes, array("d", bytes(8 * 18)))
        self._answer, self._unused = _counts(4), _counts(2)
        self._places = [_address(place) for place in (*self._kept, *self._columns)]
        self._answers = _address(self._unused), _address(self._unused) + 8, _address(self._answer)

    def __call__(self, data: bytes, at: int, line: int) -> tuple[int, int, int]:
        """Bytes and lines read, and rows written, as of `read_lines`."""
        result, fault, answer = self._answers
        self._read(result, fault, data, len(data), at, line, *self._places, self._room, answer)
        size, lines, rows, _ = self._answer
        return size, lines, rows

    def rows(self, count: int) -> Columns:
        """A copy of the rows that were written."""
        return self._columns.part(0, count)


def _counts(count: int) -> array[int]:
    return array("q", bytes(8 * count))


def _address(column: array[Any]) -> int:
    return column.buffer_info()[0]


def stored_kernels() -> Kernels | None:
    """The kernels from their object files; None where there are none, or damaged ones."""
    if not _IS_TRIED:
        return None
    try:
        return Kernels({name: _whole(_file(name).read_bytes()) for name in ENTRIES})
    except (OSError, ValueError):
        return None


def compile_kernels() -> Kernels | None:
    """The kernels, compiled now and kept where that can be. None without numba, and where nobody has tried it."""
    if not _IS_TRIED:
        return None
    try:
        from rds.nc.language.fast_lane_object import compiled
    except ImportError:
        return None
    objects = compiled()
    if objects is None:
        return None
    with suppress(OSError):
        _keep(objects)
    return Kernels(objects)


def _file(name: str) -> Path:
    return Path(__file__).parent / "__pycache__" / f"fast_lane.{_environment()}.{_sources()}.{name}.o"


def _whole(content: bytes) -> bytes:
    """The object file behind its digest; ValueError if it is damaged, which LLVM would end the process for."""
    digest, object_file = content[:_DIGEST], content[_DIGEST:]
    if hashlib.sha256(object_file).digest() != digest:
        raise ValueError("the object file is damaged")
    return object_file


def _keep(objects: dict[str, bytes]) -> None:
    """Each file whole or not at all; those that this Python made from earlier sources are removed."""
    folder = _file("").parent
    make_folder(folder)
    for old in folder.glob(f"fast_lane.{_environment()}.*.o"):
        old.unlink(missing_ok=True)
    for name, content in objects.items():
        new = folder / f"{name}.{os.getpid()}"
        with open_private(new, "wb", is_own=True) as stream:
            stream.write(hashlib.sha256(content).digest() + content)
        new.replace(_file(name))


@cache
def _environment() -> str:
    """Of what compiles and runs the machine code: Python, LLVM and the processor."""
    about = f"{sys.version} {llvmlite_version} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"
    return hashlib.sha256(about.encode()).hexdigest()[:16]


@cache
def _sources() -> str:
    """Of the text that it was compiled from."""
    folder = Path(__file__).parent
    digest = hashlib.sha256()
    for name in _SOURCES:
        digest.update((folder / name).read_bytes())
    return digest.hexdigest()[:16]
