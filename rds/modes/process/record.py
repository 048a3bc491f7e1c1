"""The raw record of a run on disk: a header line of JSON, then rows of float64. Readable however it ended.

    RDS record 1\\n
    {"columns": [...], "units": {...}, ...}\\n
    rows, little-endian float64, appended as they come

What is known only at the end stands beside it in `ending.json`. A record that was cut short anywhere is read
up to its last whole row. `processes.json` is there, and locked, for as long as somebody records.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.private_files import open_descriptor, open_private
from rds.core.types import Ending
from rds.modes.loop.changes import FILE as CHANGES
from rds.modes.loop.changes import read_changes

NAME = "record.rds"
ENDING = "ending.json"
PROCESSES = "processes.json"  # while a run goes on: the numbers of its processes
UNSTARTED = "unstarted.json"  # the ending of a run that took no sample, on its way to the host
_FIRST_LINE = b"RDS record 1\n"
_UNTOLD = "nothing was noted of its end: all its processes were killed, or it goes on; what it recorded is here"


class RecordFile:
    """Appends rows to the record of one run; takes up where an earlier writer of the same run left off.

    `about` describes the run; `about["run"]` tells it from others, whose record and results in the same directory
    are removed.
    """

    def __init__(self, directory: str | Path, about: dict[str, Any]):
        self.path = Path(directory) / NAME
        self._row = 8 * len(about["columns"])
        header = _FIRST_LINE + json.dumps(about).encode() + b"\n"
        if not _starts_with(self.path, header):
            clear(directory)
            write_whole(self.path, header)
        self._file = open(self.path, "r+b")  # noqa: SIM115  (open for the life of the object)
        self.rows = (self.path.stat().st_size - len(header)) // self._row
        self._file.truncate(len(header) + self.rows * self._row)
        self._file.seek(0, os.SEEK_END)

    def append(self, first: int, rows: bytes) -> int:
        """Append `rows`, the first of which has the number `first`; returns how many rows were missed before it."""
        skip = self.rows - first
        missed = max(-skip, 0)
        if skip > 0:
            rows = rows[skip * self._row :]
        self._file.write(rows)
        self._file.flush()
        self.rows = max(self.rows, first) + len(rows) // self._row
        return missed

    def close(self) -> None:
        """Everything is on the disk."""
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()


def claim(directory: str | Path) -> int:
    """The right to record in `directory`: an open file, whose lock ends with the last process that has it open.

    InputError if another run is being recorded there.
    """
    path = Path(directory) / PROCESSES
    while True:
        descriptor = open_descriptor(path, os.O_RDWR | os.O_CREAT)
        if not _lock(descriptor):
            os.close(descriptor)
            raise InputError("another run is being recorded there; wait for it or choose another folder", str(path))
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        os.close(descriptor)  # the run before has just taken this file away


def clear(directory: str | Path) -> None:
    """Remove what an earlier run left in `directory`: its record, its ending and its results."""
    directory = Path(directory)
    for name in (NAME, ENDING, CHANGES, *(entry.name for entry in directory.glob("result.*"))):
        with contextlib.suppress(FileNotFoundError):
            (directory / name).unlink()


def _starts_with(path: Path, header: bytes) -> bool:
    try:
        with open(path, "rb") as file:
            return file.read(len(header)) == header
    except FileNotFoundError:
        return False


def _lock(descriptor: int) -> bool:
    """Lock an open file for as long as it is open; false if somebody else has. True where there are no locks."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def write_whole(path: Path, data: bytes, is_own: bool = False) -> None:
    """Write a file so that it is there whole or not at all; with `is_own` nobody else ever reads it."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with open_private(temporary, "wb", is_own) as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise


def write_ending(directory: str | Path, ending: dict[str, Any], name: str = ENDING) -> None:
    """Write what is known at the end of a run."""
    write_whole(Path(directory) / name, json.dumps(ending, indent=1).encode())


def read_ending(directory: str | Path, name: str = ENDING) -> dict[str, Any]:
    """What a run left at its end, or an empty dict if it left nothing."""
    try:
        ending = json.loads((Path(directory) / name).read_text())
    except (OSError, ValueError):
        return {}
    return ending if isinstance(ending, dict) else {}


def read_raw(directory: str | Path) -> tuple[dict[str, Any], Any]:
    """The description and the rows (numpy array, rows × columns) of the record in `directory`.

    Raises InputError where there is no record or its header cannot be read.
    """
    import numpy as np

    path = Path(directory) / NAME
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error
    end = data.find(b"\n", len(_FIRST_LINE))
    if not data.startswith(_FIRST_LINE) or end < 0:
        raise InputError("is not a run's record", str(path))
    try:
        about = json.loads(data[len(_FIRST_LINE) : end])
        width = len(about["columns"])
    except (ValueError, KeyError, TypeError) as error:
        raise InputError("has a header that cannot be read", str(path)) from error
    body = data[end + 1 :]
    rows = np.frombuffer(body, dtype="<f8", count=len(body) // (8 * width) * width)
    return about, rows.reshape(-1, width)


class RecordTail:
    """Reads a record while it grows: `new()` gives the whole rows that have come since, as `read_raw` gives all."""

    def __init__(self, directory: str | Path):
        """InputError where there is no record yet, or its header cannot be read."""
        self.about, rows = read_raw(directory)
        self._path = Path(directory) / NAME
        self._width = rows.shape[1]
        self._read = 0  # rows
        with open(self._path, "rb") as file:
            file.readline()
            file.readline()
            self._first = file.tell()

    def new(self) -> Any:
        """Rows × columns; none where the record has gone."""
        import numpy as np

        data = b""
        with contextlib.suppress(OSError), open(self._path, "rb") as file:
            file.seek(self._first + 8 * self._width * self._read)
            data = file.read()
        rows = np.frombuffer(data, dtype="<f8", count=len(data) // (8 * self._width) * self._width)
        rows = rows.reshape(-1, self._width)
        self._read += len(rows)
        return rows


def table(names: Sequence[str], units: Mapping[str, str], rows: Any, T: float) -> tuple[dict[str, Any], dict[str, str]]:
    """Rows as a loop recorded them as columns with their units: time = sample·T in s, stages of a sample in µs."""
    columns, of = {}, {}
    for name, values in zip(names, rows.T, strict=True):
        if name == "sample":
            columns["time"], of["time"] = values * T, "s"
        elif units.get(name) == "ns":
            columns[name], of[name] = values / 1e3, "µs"
        else:
            columns[name], of[name] = values, units.get(name, "")
    return columns, of


def read_record(directory: str | Path) -> tuple[dict[str, Any], dict[str, str], dict[str, Any]]:
    """Columns, units and description of the record in `directory`, up to its last whole row.

    `ending` is what the run noted itself, else that it was killed, as of one that goes on. Raises InputError for a
    record that can't be read.
    """
    about, rows = read_raw(directory)
    left = read_ending(directory) or {"reason": _UNTOLD}
    try:
        units, period, expected = about["units"], about["sample_period"], about["samples"]
        columns, units = table(about["columns"], units, rows, period)
        meta = {
            "axes": about["axes"],
            "sample_period": period,
            "duration": expected * period,
            "mode": about.get("mode"),
            "machine": about.get("machine"),
            "ending": left.get("ending", str(Ending.KILLED)),
            "ending_reason": left.get("reason", ""),
            "environment": left.get("environment", {}),
            "changes": [list(change) for change in read_changes(directory)],
            "notes": [f"read from the run's raw record: {len(rows)} of {expected} samples"],
        }
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"its header lacks {error}; it was written by another version of rds", str(Path(directory) / NAME)
        ) from error
    return columns, units, meta
