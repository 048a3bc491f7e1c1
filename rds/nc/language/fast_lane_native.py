"""The fast lane's kernels as machine code from a file that numba has compiled once.

Importing numba and having it look through what it has kept takes longer than 100,000 lines of a program. Where the
computer has a linker (`ld`, of binutils), the file is a shared library, which is loaded in a thousandth of a second;
else it is an object file, which llvmlite loads in some twentieth. It lies with Python's own compiled files, and is made
anew whenever anything that went into it has changed.
"""

from __future__ import annotations

import ctypes
from array import array
from collections.abc import Callable, Iterator

from rds.nc.language.batch import FLOATS, FOUND, MODES, WORDS
from rds.nc.language.fast_lane_files import ENTRIES, IS_TRIED, file_of, library, whole
from rds.nc.language.motion_rows import Columns, empty

_WORK = WORDS + 6  # and the target of its move
_OUT = 1 << 20  # bytes of text at once
_POINTER, _WHOLE = ctypes.c_void_p, ctypes.c_int64
# numba's convention: the result and what an exception would be (neither is used), then the arguments
_HEAD = (ctypes.c_int32, _POINTER, _POINTER)
READ = ctypes.CFUNCTYPE(*_HEAD, _POINTER, _WHOLE, _WHOLE, _WHOLE, *([_POINTER] * 9), _WHOLE, _POINTER)
WRITE = ctypes.CFUNCTYPE(*_HEAD, _WHOLE, *([_POINTER] * 4), _WHOLE, _POINTER, _WHOLE, _POINTER, _WHOLE, _POINTER)


class Kernels:
    """The kernels, ready to be called: at two addresses of what `library` keeps."""

    def __init__(self, read: int, write: int, library: object):
        self._read, self._write, self._library = READ(read), WRITE(write), library
        self._answer, self._unused = _counts(4), _counts(2)
        self._out: ctypes.Array[ctypes.c_char] | None = None

    def reader(self, state: array[float], modes: array[int], rows: int) -> LineReader:
        return LineReader(self._read, state, modes, rows)

    def written(self, columns: Columns, number: int, quoted: bytes = b"") -> Iterator[tuple[int, str]]:
        """The text of rows, numbered from `number`, in portions: rows of it and their lines. `quoted`: of a batch.

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
            rest = (rows - first, quoted, len(quoted), out, _OUT, answer)
            self._write(unused, unused + 8, number + first, *places, *rest)
            count, size = self._answer[:2]
            yield (count, ctypes.string_at(out, size).decode("ascii")) if count else (1, "")
            first += count or 1


class LineReader:
    """The reader of plain lines for one run, with room for so many rows."""

    def __init__(self, read: Callable[..., int], state: array[float], modes: array[int], rows: int):
        assert len(state) == FLOATS
        assert len(modes) == MODES
        self._read, self._room = read, rows
        self._columns = empty(rows)
        self._kept = (state, modes, array("d", bytes(8 * _WORK)), _counts(FOUND))
        self._answer, self._unused = _counts(4), _counts(2)
        self._places = [_address(place) for place in (*self._kept, *self._columns)]
        self._answers = _address(self._unused), _address(self._unused) + 8, _address(self._answer)

    def __call__(self, data: bytes, at: int, line: int) -> tuple[int, int, int, int]:
        """Bytes and lines read, rows written, and how many of these are calls, as of `read_lines`."""
        result, fault, answer = self._answers
        self._read(result, fault, data, len(data), at, line, *self._places, self._room, answer)
        size, lines, rows, calls = self._answer
        return size, lines, rows, calls

    def rows(self, count: int) -> Columns:
        """A copy of the rows that were written."""
        return self._columns.part(0, count)


def _counts(count: int) -> array[int]:
    return array("q", bytes(8 * count))


def _address(column: array[float] | array[int]) -> int:
    return column.buffer_info()[0]


def stored_kernels() -> Kernels | None:
    """The kernels from what was compiled before; None where there is nothing, or it is damaged."""
    if not IS_TRIED:
        return None
    shared = library()
    if shared is not None:
        found = [ctypes.cast(getattr(shared, name), _POINTER).value for name in ENTRIES]
        return Kernels(found[0] or 0, found[1] or 0, shared)
    try:
        objects = {name: whole(file_of(f"{name}.o")) for name in ENTRIES}
        from rds.nc.language.fast_lane_target import loaded
    except (OSError, ValueError, ImportError):
        return None
    return Kernels(*loaded(objects))


def compile_kernels() -> Kernels | None:
    """The kernels, compiled now and kept where that can be. None without numba, and where nobody has tried it."""
    if not IS_TRIED:
        return None
    try:
        from rds.nc.language.fast_lane_object import compiled, keep, objects
        from rds.nc.language.fast_lane_target import loaded
    except ImportError:
        return None
    texts = compiled()
    if texts is None:
        return None
    keep(texts)
    return stored_kernels() or Kernels(*loaded(objects(texts, shared=False)))
