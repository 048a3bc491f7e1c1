"""The raw record of a run on disk: a header line of JSON, then rows of float64. Readable however it ended.

    RDS record 1\\n
    {"columns": [...], "units": {...}, ...}\\n
    rows, little-endian float64, appended as they come

What is known only at the end stands beside it in `ending.json`. A record that was cut short anywhere is read
up to its last whole row.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from rds.core.errors import InputError

NAME = "record.rds"
ENDING = "ending.json"
PROCESSES = "processes.json"  # while a run goes on: the numbers of its processes
_FIRST_LINE = b"RDS record 1\n"


class RecordFile:
    """Appends rows to a record; takes up where an earlier writer left off."""

    def __init__(self, directory: str | Path, about: dict[str, Any]):
        self.path = Path(directory) / NAME
        self._row = 8 * len(about["columns"])
        header = _FIRST_LINE + json.dumps(about).encode() + b"\n"
        if not self.path.exists():
            write_whole(self.path, header)
        self._file = open(self.path, "r+b")  # noqa: SIM115  (open for the life of the object)
        whole = (self.path.stat().st_size - len(header)) // self._row
        self.rows = whole
        self._file.truncate(len(header) + whole * self._row)
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


def clear(directory: Path) -> None:
    """Make room for a new record: take away that of an earlier run; InputError while that one is still going."""
    processes = directory / PROCESSES
    try:
        pids = json.loads(processes.read_text())
        os.kill(int(pids["recorder"]), 0)
    except (OSError, ValueError, KeyError, TypeError):
        pass  # no run, or one whose recorder is gone
    else:
        raise InputError(f"a run is recording there (process {pids['recorder']}); give another folder", str(directory))
    for name in (NAME, ENDING, PROCESSES, "target.json", "target.log"):
        (directory / name).unlink(missing_ok=True)


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is there whole or not at all."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    with open(temporary, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def write_ending(directory: str | Path, ending: dict[str, Any]) -> None:
    """Write what is known at the end of a run."""
    write_whole(Path(directory) / ENDING, json.dumps(ending, indent=1).encode())


def read_ending(directory: str | Path) -> dict[str, Any]:
    """What a run left in `ending.json`, or an empty dict if it left none."""
    try:
        ending = json.loads((Path(directory) / ENDING).read_text())
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
