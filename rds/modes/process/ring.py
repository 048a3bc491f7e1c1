"""The shared memory between target, recorder and host: rows of numbers in a ring, one writer, many readers.

The writer never waits. Readers look at `head`, the number of rows written so far, and copy the rows they have
not seen; a row is complete before `head` counts it. One file, mapped by every process that takes part.
"""

from __future__ import annotations

import json
import mmap
import struct
from pathlib import Path
from typing import IO, Any

from rds.core.errors import InputError
from rds.modes.loop.shared_words import read_word, write_word
from rds.modes.process.shared import hold, make

_MAGIC = b"RDSRING1"
_HEADER = 16384  # bytes before the first row: counters, then the description as JSON
_HEAD, _STOP, _HEARTBEAT, _TEXT_SIZE, _TEXT = 8, 16, 24, 32, 64


class Ring:
    """Rows of `len(columns)` float64 values, `capacity` of them kept."""

    def __init__(self, path: str | Path, memory: mmap.mmap, about: dict[str, Any], file: IO[bytes]):
        self.path = Path(path)
        self._file = file  # which is held, see runtime.shared
        self.about = about
        self.columns: list[str] = about["columns"]
        self.capacity: int = about["capacity"]
        self._memory = memory
        self._row = struct.Struct(f"<{len(self.columns)}d")
        self._head = self.head

    @classmethod
    def create(cls, path: str | Path, columns: list[str], capacity: int, **about: Any) -> Ring:
        """A new ring in the file `path`; `about` (JSON) travels in its header. OSError if there is no room for it."""
        description = {"columns": columns, "capacity": capacity, **about}
        text = json.dumps(description).encode()
        if len(text) > _HEADER - _TEXT:
            raise InputError(
                f"the run's {len(columns)} columns take {len(text)} bytes to describe, of {_HEADER - _TEXT} there are; "
                "let controllers declare fewer signals, or give these shorter names"
            )
        size = _HEADER + capacity * 8 * len(columns)
        make(path, size)
        memory, file = _map(path)
        memory[_TEXT : _TEXT + len(text)] = text
        write_word(memory, _TEXT_SIZE, len(text))
        memory[: len(_MAGIC)] = _MAGIC
        return cls(path, memory, description, file)

    @classmethod
    def open(cls, path: str | Path) -> Ring:
        """The ring in an existing file."""
        memory, file = _map(path)
        if memory[: len(_MAGIC)] != _MAGIC:
            file.close()
            raise InputError("not a run's shared memory", str(path))
        size = read_word(memory, _TEXT_SIZE)
        return cls(path, memory, json.loads(memory[_TEXT : _TEXT + size]), file)

    @property
    def head(self) -> int:
        """Rows written so far."""
        return read_word(self._memory, _HEAD)

    def append(self, row: list[float]) -> None:
        """Write one row; overwrites the oldest when the ring is full."""
        head = self._head
        self._row.pack_into(self._memory, _HEADER + head % self.capacity * self._row.size, *row)
        self._head = head + 1
        write_word(self._memory, _HEAD, head + 1)

    def read(self, first: int) -> tuple[int, bytes]:
        """The rows from number `first` on, as bytes, and the number of the first one that is still there."""
        head = self.head
        first = max(first, head - self.capacity, 0)
        size = self._row.size
        start, end = first % self.capacity, head % self.capacity
        if first >= head:
            return first, b""
        memory = self._memory
        if start < end:
            data = memory[_HEADER + start * size : _HEADER + end * size]
        else:
            data = memory[_HEADER + start * size : _HEADER + self.capacity * size]
            data += memory[_HEADER : _HEADER + end * size]
        # Rows that the writer overwrote while they were being copied are not whole.
        lost = max(self.head - self.capacity - first + 1, 0) if self.head > self.capacity else 0
        return first + lost, data[lost * size :]

    @property
    def live_values_path(self) -> Path:
        """Where the live values of the same run are (see `loop.live_values`)."""
        return self.path.with_suffix(".live")

    def ask_to_stop(self) -> None:
        """Ask the writer for a safe end at its next sample."""
        self._memory[_STOP] = 1

    def stop_asked(self) -> bool:
        """Whether somebody asked for the end."""
        return self._memory[_STOP] != 0

    @property
    def heartbeat(self) -> int:
        """How far the target has come, by a count that it changes while it gets ready and when it closes."""
        return read_word(self._memory, _HEARTBEAT)

    def beat(self, count: int) -> None:
        """Say that the target has come to step `count`."""
        write_word(self._memory, _HEARTBEAT, count)

    def close(self) -> None:
        """Unmap; the file stays."""
        self._memory.close()
        self._file.close()


def _map(path: str | Path) -> tuple[mmap.mmap, IO[bytes]]:
    file = open(path, "r+b")  # noqa: SIM115 (held as long as it is mapped)
    try:
        hold(file)
        return mmap.mmap(file.fileno(), 0), file
    except BaseException:
        file.close()
        raise
