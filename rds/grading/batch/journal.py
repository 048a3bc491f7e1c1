"""The journal of a batch: one line for each finished submission, on the disk before the next thing is done.

A line is JSON with a check sum. What a kill left of a last line is cut off; any other fault is told, and nothing is
graded on top of it.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from rds.core.errors import InputError
from rds.core.private_files import make_folder, open_descriptor

try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # Windows, where a batch is graded in a container, and reviewed outside: nobody is kept out there
    flock = None  # type: ignore[assignment]

FILE = "journal.jsonl"
_FLAGS = os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_BINARY", 0)
_CHECK = 16  # hex digits


class Journal:
    """Opened by one process at a time. `rows` is what `of` makes of the finished ones, in the order of their writing.

    `was_torn` says whether a half-written last line was cut off. InputError if another process has it, a line in it is
    damaged, or it cannot be written.
    """

    def __init__(self, path: Path, of: Callable[[dict[str, Any]], Any] = lambda row: row):
        self.path = path
        self.was_torn = False
        try:
            make_folder(path.parent)
            self._fd = open_descriptor(path, _FLAGS)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}; choose another place", str(path)) from error
        try:
            try:
                if flock is not None:
                    flock(self._fd, LOCK_EX | LOCK_NB)
            except OSError:
                raise InputError(
                    "another rds grade run, or another grader, is at work here; wait for its end", str(path)
                ) from None
            self.rows, good = _whole_lines(path, of)
            if good < os.fstat(self._fd).st_size:
                self.was_torn = True
                os.ftruncate(self._fd, good)
                os.fsync(self._fd)
        except BaseException:
            os.close(self._fd)
            raise

    def append(self, row: Mapping[str, Any]) -> None:
        """One row, on the disk when this returns. InputError where the system refuses to write."""
        data = line(row)
        try:
            while data:
                data = data[os.write(self._fd, data) :]
            os.fsync(self._fd)
        except OSError as error:  # what is there of the line is cut off when the journal is opened again
            said = f"cannot be written: {error.strerror}; make room, and go on with --resume: what is graded is kept"
            raise InputError(said, str(self.path)) from error

    def close(self) -> None:
        """Let others have it."""
        os.close(self._fd)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def read_journal(path: Path, of: Callable[[dict[str, Any]], Any] = lambda row: row) -> list[Any]:
    """Its rows, while whoever writes it goes on, or what `of` makes of each. InputError if a line in it is damaged."""
    return _whole_lines(path, of)[0] if path.exists() else []


def line(row: Mapping[str, Any]) -> bytes:
    """A row as it stands in the file."""
    text = json.dumps(row, allow_nan=False, sort_keys=True)
    return f"{_sum(text)} {text}\n".encode()


def _whole_lines(path: Path, of: Callable[[dict[str, Any]], Any] = lambda row: row) -> tuple[list[Any], int]:
    """What `of` makes of the rows, and how many bytes they take. Read line by line: a class's may be long."""
    rows: list[Any] = []
    good, size = 0, path.stat().st_size
    with open(path, "rb") as file:
        for number, text in enumerate(file, 1):
            row = _row(text[:-1]) if text.endswith(b"\n") else None
            if row is None:
                if good + len(text) >= size:  # the power went while it was written
                    break
                raise InputError(
                    "is damaged: its check sum is wrong; restore the file, or grade into a new folder",
                    f"{path}: line {number}",
                )
            rows.append(of(row))
            good += len(text)
    return rows, good


def _row(text: bytes) -> dict[str, Any] | None:
    head, _, rest = text.partition(b" ")
    try:
        told = rest.decode()
        if head.decode() != _sum(told):
            return None
        row = json.loads(told)
    except ValueError:
        return None
    return row if isinstance(row, dict) else None


def _sum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:_CHECK]
