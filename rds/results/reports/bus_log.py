"""Frames from a bus log: python-can's formats (ASC, BLF, candump, TRC, ...) or a table of time, identifier and data."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rds.core.errors import InputError
from rds.results.reports.pairing import Frame
from rds.results.reports.reading import Column, read_columns, read_text

_SECONDS = {"s": 1.0, "": 1.0, "ms": 1e-3, "us": 1e-6}
_EXAMPLE = "'time_s,id,data', then '0.0012,001,0100000000000000'"


def is_log(path: Path) -> bool:
    """Whether the file's ending is one of a bus log of python-can's other than CSV."""
    from rds.bus.tools.log_formats import ENDINGS

    return path.suffix.lower() in {*ENDINGS, ".gz"} - {".csv"}


def read_frames(path: Path) -> list[Frame]:
    """The data frames of a log, in its order, without error and remote frames.

    A CSV file is either python-can's or has the columns time (in s, ms or us), id and data, both in hexadecimal; an id
    of eight digits is an extended one. Raises InputError for a file that is none of this, is damaged or holds no data
    frame.
    """
    if not path.is_file():
        raise InputError("there is no such file; check the name of the log", str(path))
    if path.suffix.lower() in (".csv", ".txt", ".tsv") and not _is_python_can_csv(path):
        frames = list(_table(path))
    else:
        frames = list(_log(path))
    if not frames:
        from rds.bus.tools.log_formats import ENDINGS

        raise InputError(
            "it has no data frames; record the bus while requests are answered, and keep the log's ending "
            f"({', '.join(ENDINGS)})",
            str(path),
        )
    return frames


def _is_python_can_csv(path: Path) -> bool:
    return read_text(path).startswith("timestamp,arbitration_id,")


def _log(path: Path) -> Iterator[Frame]:
    from rds.bus.tools.logs import LogFile  # names every damage, where python-can's readers pass over some

    for message in LogFile(path):
        if not (message.is_error_frame or message.is_remote_frame):
            yield Frame(message.timestamp, message.arbitration_id, message.is_extended_id, bytes(message.data))


def _table(path: Path) -> Iterator[Frame]:
    columns = {column.name.lower(): column for column in read_columns(path)}
    missing = [name for name in ("time", "id", "data") if name not in columns]
    if missing:
        raise InputError(
            f"it has no column {missing[0]!r}, but {', '.join(c.heading for c in columns.values())}; "
            f"write a log as in {_EXAMPLE}",
            str(path),
        )
    time = columns["time"]
    if time.unit not in _SECONDS:
        raise InputError(f"column {time.heading!r} is in {time.unit!r}; give times in s, ms or us", str(path))
    times = [_SECONDS[time.unit] * value for value in time.numbers(least=1)]
    for at, (line, text) in zip(times, columns["id"].cells.items(), strict=True):
        identifier, extended = _identifier(columns["id"], line, text)
        yield Frame(at, identifier, extended, _bytes(columns["data"], line))


def _identifier(column: Column, line: int, text: str) -> tuple[int, bool]:
    digits = text.removeprefix("0x").removeprefix("0X")
    try:
        identifier = int(digits, 16)
    except ValueError:
        raise column.fault(line, f"{text!r} is not an identifier; write it in hexadecimal, as in 0x7FF") from None
    extended = len(digits) == 8
    if not 0 <= identifier < 1 << (29 if extended else 11):
        raise column.fault(
            line, f"identifier {text!r} is out of range; a standard one is at most 7FF, an extended one has 8 digits"
        )
    return identifier, extended


def _bytes(column: Column, line: int) -> bytes:
    text = column.cells[line]
    try:
        data = bytes.fromhex(text.removeprefix("0x"))
    except ValueError:
        raise column.fault(line, f"{text!r} is not data; write bytes in hexadecimal, as in '01 00 FF'") from None
    if len(data) > 64:
        raise column.fault(line, f"it has {len(data)} bytes; a frame carries at most 64")
    return data
