"""python-can's log writers, each with a `flush()` after which a killed recording can be read.

A disk that becomes full leaves half of a line or of a container at the end of a file, which no reader takes;
`abandon()` cuts it off.
"""

from __future__ import annotations

import contextlib
import gzip
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TextIO, cast

import can

from rds.bus.tools.log_formats import FORMATS, named
from rds.bus.tools.mf4 import asammdf_missing, bring_asammdf
from rds.core.private_files import open_private

_LONGEST_LINE = 4096  # bytes, and more than any frame's
_LEAST_EPOCH = 631152000.0  # s; BLF keeps no start before 1990


class Writer(Protocol):
    """What a log needs of its format."""

    def on_message_received(self, msg: can.Message) -> None: ...
    def flush(self) -> None: ...
    def stop(self) -> None: ...
    def abandon(self) -> None: ...  # after an OSError: close the file, and leave of it what can be read


def open_writer(path: Path, ending: str, packed: bool) -> Writer:
    """A writer that begins the file anew. InputError if a package is missing."""
    kind = FORMATS[ending]
    if kind.rules is None:
        writer: Writer = named(kind.writer)(path)
        return writer
    how: dict[str, Any] = {"mode": "wt", "encoding": "utf-8", "newline": "\n"}  # the same on every system
    file = cast(TextIO, gzip.open(path, **how) if packed else path.open(**how))  # noqa: SIM115
    return TextWriter(file, named(kind.writer), None if packed else path)


class CandumpWriter(can.CanutilsLogWriter):
    """Keeps the length that a remote frame asks for, which python-can's reader knows and its writer forgets."""

    def on_message_received(self, msg: can.Message) -> None:
        if not (msg.is_remote_frame and msg.dlc):
            super().on_message_received(msg)
            return
        identifier = f"{msg.arbitration_id:08X}" if msg.is_extended_id else f"{msg.arbitration_id:03X}"
        channel = f"can{msg.channel}" if str(msg.channel).isdigit() else msg.channel or self.channel
        self.file.write(f"({msg.timestamp:f}) {channel} {identifier}#R{msg.dlc} {'R' if msg.is_rx else 'T'}\n")


class TextWriter:
    """A text, written by a class of python-can's or one like it.

    `path` is where whole lines are the text's own: not where it is compressed.
    """

    def __init__(self, file: TextIO, writer: Callable[[TextIO], Any], path: Path | None):
        self._file, self._path = file, path
        self._writer = writer(file)
        self.on_message_received = self._writer.on_message_received

    def flush(self) -> None:
        """To the operating system: a killed process loses nothing of it."""
        self._file.flush()

    def stop(self) -> None:
        """Finish and close."""
        if not self._file.closed:
            self._writer.stop()

    def abandon(self) -> None:
        """Leave whole lines."""
        with contextlib.suppress(OSError):  # it tries to write what waits once more
            self._file.close()
        if self._path is not None and self._path.is_file():  # no device and no pipe
            with self._path.open("rb+") as file:
                start = max(0, file.seek(0, os.SEEK_END) - _LONGEST_LINE)
                file.seek(start)
                file.truncate(start + file.read().rfind(b"\n") + 1)


class BlfWriter:
    """BLF keeps its start time and object count in a header that is written at the end, so each flush ends the file."""

    def __init__(self, path: Path):
        self._path = path
        self._writer = can.BLFWriter(path)
        self._shift: float | None = None  # s
        self._stopped = False
        self._new = False  # since the last flush
        self._whole = 0  # bytes of the file as the last flush left it

    def on_message_received(self, msg: can.Message) -> None:
        """Add a frame."""
        if self._shift is None:  # times that do not begin at an epoch begin at 0, as the header will say
            self._shift = msg.timestamp if msg.timestamp < _LEAST_EPOCH else 0.0
        msg.timestamp -= self._shift
        self._writer.on_message_received(msg)
        self._new = True

    def flush(self) -> None:
        """End the file and go on behind its end."""
        if self._new:
            self._new = False
            self._writer.stop()
            self._whole = self._path.stat().st_size
            self._writer = can.BLFWriter(self._path, append=True)

    def stop(self) -> None:
        """Finish and close."""
        if not self._stopped:
            self._stopped = True
            self._writer.stop()

    def abandon(self) -> None:
        """Leave the file as the last flush left it."""
        self._stopped = True
        with contextlib.suppress(OSError):  # it tries to write what waits once more
            self._writer.file.close()
        if self._path.is_file():
            os.truncate(self._path, self._whole)


class DatabaseWriter:
    """python-can's table of frames in SQLite.

    Not by python-can's writer: that one writes in a thread, forgets frames that are waiting at the end, and a disk
    that is full ends the thread in silence.
    """

    _TABLE = (
        "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, "
        "dlc INTEGER, data BLOB)"
    )

    def __init__(self, path: Path):
        path.unlink(missing_ok=True)
        open_private(path, "xb").close()  # SQLite leaves the mode of a file as it is, and so of its journal
        self._connection: sqlite3.Connection | None = sqlite3.connect(path)
        self._rows: list[tuple[object, ...]] = []
        self._execute(self._TABLE)

    def on_message_received(self, msg: can.Message) -> None:
        """Add a frame."""
        self._rows.append(
            (
                msg.timestamp,
                msg.arbitration_id,
                msg.is_extended_id,
                msg.is_remote_frame,
                msg.is_error_frame,
                msg.dlc,
                bytes(msg.data),
            )
        )

    def flush(self) -> None:
        """Commit what waits."""
        rows, self._rows = self._rows, []
        if rows:
            self._execute("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)

    def stop(self) -> None:
        """Commit and close."""
        if self._connection is None:
            return
        try:
            self.flush()
        finally:
            self._connection.close()
            self._connection = None

    def abandon(self) -> None:
        """Leave what was committed."""
        self._rows = []
        self.stop()

    def _execute(self, statement: str, rows: list[tuple[object, ...]] | None = None) -> None:
        assert self._connection is not None, "the log is closed"
        try:
            with self._connection:
                if rows is None:
                    self._connection.execute(statement)
                else:
                    self._connection.executemany(statement, rows)
        except sqlite3.Error as error:
            raise OSError(f"the log can't be written: {error}") from error


class Mf4Writer:
    """MDF is put together in memory and written at the end."""

    def __init__(self, path: Path):
        bring_asammdf()
        try:
            self._writer = can.MF4Writer(path)
        except NotImplementedError as error:
            path.unlink(missing_ok=True)  # made empty to claim the name
            raise asammdf_missing(path) from error
        self._stopped = False
        self.on_message_received = self._writer.on_message_received

    def flush(self) -> None:
        """Nothing that could be done."""

    def stop(self) -> None:
        """Write the file."""
        if not self._stopped:
            self._stopped = True
            self._writer.stop()

    def abandon(self) -> None:
        """Nothing that could be done."""
        self._stopped = True
