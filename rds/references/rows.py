"""Reading and checking the rows of a signal's CSV file."""

from __future__ import annotations

import csv
import re
from math import isfinite
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import TABLE, read_limited

COLUMNS = {2: "time,value", 4: "time,position,velocity,acceleration"}
# "time [ms]", "time_ms", "t/ms"; but v_in and u_min have an index
_UNIT = re.compile(r"[\[(]\s*(.*?)\s*[\])]|(?:_|/\s*)(ms|us|µs|ns|um|µm|cm|mV|kV)$|(?:^t|[^_]{3,})_(m|min)$")
_UNITS = {  # that are the columns' own; rotary axes have degrees in place of mm, a spindle rev/min
    "time": ("s", "sec", "second", "seconds"),
    "value": ("mm", "v", "volt", "volts", "deg", "°", "degree", "degrees", "rev/min", "rpm", "1/min"),
    "position": ("mm", "deg", "°", "degree", "degrees", "rev/min", "rpm", "1/min"),
    "velocity": ("mm/s", "deg/s", "°/s", "degrees/s", "rev/min/s"),
    "acceleration": ("mm/s²", "mm/s^2", "mm/s2", "mm/s/s", "deg/s²", "deg/s^2", "deg/s2", "°/s²", "rev/min/s²"),
}
_LONGEST = 10_000  # characters of a line
_ROUNDING = 1e-5  # of the largest value of a column: what five printed digits lose


def read_rows(file: str | Path) -> np.ndarray:
    """The rows of `file` as an array with 2 or 4 columns: s, then V or mm, mm/s, mm/s².

    A header line, blank lines and lines that begin with # are allowed. Raises InputError, naming file and line, for a
    file that cannot be read, a cell that is no finite number, times that do not increase, fewer than two rows, or
    velocities and accelerations that do not belong to the positions.
    """
    numbers: list[int] = []
    rows: list[list[float]] = []
    for number, cells in _lines(Path(file)):
        place = f"{file}:{number}"
        if not rows and not any(map(_is_number, cells)):
            _check_header(cells, place)
            continue
        row = _row(cells, place)
        if rows and len(row) != len(rows[0]):
            what = f"this row has {len(row)} columns, the ones before it {len(rows[0])}"
            raise InputError(f"{what}; repair or remove it", place)
        if rows and row[0] <= rows[-1][0]:
            raise InputError(f"time {row[0]:g} s does not come after {rows[-1][0]:g} s; times must increase", place)
        numbers.append(number)
        rows.append(row)
    if len(rows) < 2:
        raise InputError(f"it has {len(rows)} rows of numbers; a signal needs at least two", str(file))
    table = np.array(rows)
    if table.shape[1] == 4:
        _check_motion(table, numbers, file)
    return table


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    try:
        text = read_limited(path, TABLE, "a signal", "give a part of it").decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; check the file's name", str(path)) from error
    except UnicodeDecodeError as error:
        raise InputError("it is not UTF-8 text; save it as CSV", str(path)) from error
    lines = []
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _LONGEST:
            raise InputError(f"it has {len(line)} characters; a row is 2 or 4 numbers", f"{path}, line {number}")
        if line.strip() and not line.lstrip().startswith("#"):
            lines.append((number, [cell.strip() for cell in next(csv.reader([line]))]))
    return lines


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _check_header(cells: list[str], place: str) -> None:
    if len(cells) not in COLUMNS:
        raise InputError(_wrong_columns(len(cells)), place)
    if not cells[0].lower().startswith("t"):
        raise InputError(f"the first column is {cells[0]!r}; it must be the time, as in {COLUMNS[len(cells)]!r}", place)
    for cell, column in zip(cells, COLUMNS[len(cells)].split(","), strict=True):
        found = _UNIT.search(cell)
        unit = (found[1] or found[2] or found[3]) if found else None
        if unit and unit.lower() not in (own := _UNITS[column]):
            raise InputError(
                f"the column {cell!r} is in {unit}; give the {column} in {'mm or V' if column == 'value' else own[0]}, "
                "and a heading with that unit or none",
                place,
            )


def _row(cells: list[str], place: str) -> list[float]:
    if len(cells) not in COLUMNS:
        raise InputError(_wrong_columns(len(cells)), place)
    row = []
    for cell, column in zip(cells, COLUMNS[len(cells)].split(","), strict=True):
        if not _is_number(cell) or not isfinite(float(cell)):
            raise InputError(f"{column} = {cell!r} must be a finite number", place)
        row.append(float(cell))
    return row


def _wrong_columns(count: int) -> str:
    what = "1 column" if count == 1 else f"{count} columns"
    return f"it has {what}; it needs {' or '.join(COLUMNS.values())}, separated by commas"


def _check_motion(table: np.ndarray, numbers: list[int], file: str | Path) -> None:
    """InputError at the first row that the velocity or acceleration around it cannot lead to.

    The mean of a rate between two rows lies between its values at the rows, give or take what its own rate can
    change in that time.
    """
    dt = np.diff(table[:, 0])
    for column, rate, unit in ((1, "velocity", "mm/s"), (2, "acceleration", "mm/s²")):
        rates = table[:, column + 1]
        mean = np.diff(table[:, column]) / dt
        low, high = np.minimum(rates[:-1], rates[1:]), np.maximum(rates[:-1], rates[1:])
        slopes = np.abs(np.diff(rates) / dt)  # of an acceleration: between two rows beside its peak the mean is higher
        bends = np.abs(table[:, 3]) if column == 1 else np.maximum(np.append(slopes, 0.0), np.insert(slopes, 0, 0.0))
        slack = (bends[:-1] + bends[1:]) * dt / 2.0 + (high - low) / 2.0
        slack += _ROUNDING * (np.abs(rates).max() + 2.0 * np.abs(table[:, column]).max() / dt)
        wrong = np.flatnonzero((mean < low - slack) | (mean > high + slack))
        if wrong.size:
            i = int(wrong[0])
            what = COLUMNS[4].split(",")[column]
            raise InputError(
                f"from {table[i, 0]:g} to {table[i + 1, 0]:g} s the {what} changes by {mean[i]:g} {unit} on average, "
                f"but the {rate} is {rates[i]:g} and {rates[i + 1]:g} {unit}; the columns must belong together, "
                f"or give time,value alone",
                f"{file}:{numbers[i + 1]}",
            )
