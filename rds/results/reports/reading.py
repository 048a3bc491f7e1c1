"""Measured tables: a CSV file with one row of headings, each naming its unit, and numbers below.

A heading gives its unit in brackets, as in `cw [A]`, or as its ending, as in `cw_A`. Cells are separated by commas,
semicolons or tabs; where they are not separated by commas, a decimal comma is read as well.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from rds.core import toml_file
from rds.core.errors import InputError
from rds.core.limits import TABLE, read_limited
from rds.results.units import split_heading

ENDINGS = ("counts", "adc", "mm", "deg", "min", "ms", "us", "mA", "A", "mV", "V", "g", "s")
BEYOND_MEASURE = 1e15  # no reading or option has a larger magnitude; their squares and sums stay finite
ORDINALS = ("reading", "iteration", "move", "index", "n", "count")  # columns that only number the rows


@dataclass(frozen=True)
class Column:
    """One column: its name and unit ("" where the heading gives none), and its cells as text by line of the file."""

    heading: str
    name: str
    unit: str
    cells: dict[int, str]
    where: str  # the file
    decimal_comma: bool = False

    def numbers(self, least: int = 2, blanks: bool = False) -> list[float]:
        """The cells as finite numbers; `blanks`: empty cells are left out.

        Raises InputError with line and column for any other cell, or where there are fewer than `least` numbers.
        """
        values = [self._number(line, cell) for line, cell in self.cells.items() if cell or not blanks]
        if len(values) < least:
            raise InputError(
                f"column {self.heading!r} has {len(values)} value{'' if len(values) == 1 else 's'}; "
                f"it needs at least {least}: give the readings below the heading, one to a line",
                self.where,
            )
        return values

    def _number(self, line: int, cell: str) -> float:
        try:
            number = float(cell.replace(",", ".") if self.decimal_comma else cell)
        except ValueError:
            raise self.fault(
                line, f"{cell!r} is not a number; give a number in {self.unit or 'plain digits'}"
            ) from None
        if not isfinite(number):
            raise self.fault(line, f"{cell!r} is not a finite number; leave the reading out")
        if abs(number) > BEYOND_MEASURE:
            raise self.fault(line, f"{cell!r} is beyond what is measured ({BEYOND_MEASURE:g}); leave the reading out")
        return number

    def fault(self, line: int, message: str) -> InputError:
        """An error about the cell in this line."""
        return InputError(message, f"{self.where}, line {line}, column {self.heading!r}")


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, with or without its mark. InputError if it isn't there or is not text."""
    try:
        data = read_limited(path, TABLE, "a table of readings", "give a part of it")
        text = io.StringIO(data.decode("utf-8-sig"), newline=None).read()
    except UnicodeDecodeError as error:
        raise InputError(f"it is not a text file in UTF-8 ({error}); save it as CSV (UTF-8)", str(path)) from error
    except OSError as error:
        raise InputError(f"cannot read: {error.strerror or error}; check the name of the file", str(path)) from error
    if "\0" in text:
        raise InputError("it is not a text file; save it as CSV (UTF-8)", str(path))
    return text


def read_columns(path: Path) -> list[Column]:
    """The columns of a table, without those that only number the rows; empty lines are passed over.

    Raises InputError for a missing or empty file, a line with too many or too few cells, or a heading given twice.
    """
    where = str(path)
    text = read_text(path)
    first = text.lstrip("\r\n").split("\n", 1)[0]
    delimiter = max(",;\t", key=first.count)
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    try:
        rows = [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(map(str.strip, row))]
    except csv.Error as error:
        raise InputError(f"{error}; save it as CSV", f"{where}, line {reader.line_num}") from error
    if not rows:
        raise InputError("it is empty; give a row of headings, then the readings", where)
    (_, headings), *body = rows
    if not body:
        raise InputError(f"it has headings ({', '.join(headings)}) and no readings; give at least two rows", where)
    doubled = next((heading for heading in headings if headings.count(heading) > 1), None)
    if doubled is not None:
        raise InputError(f"two columns are headed {doubled!r}; rename one", where)
    for line, row in body:
        if len(row) != len(headings):
            raise InputError(
                f"it has {len(row)} cells where the headings are {len(headings)} ({', '.join(headings)}); "
                "write one cell below each heading",
                f"{where}, line {line}",
            )
    columns = []
    for at, heading in enumerate(headings):
        name, unit = split_unit(heading)
        if name.lower() not in ORDINALS or unit:
            cells = {line: row[at] for line, row in body}
            columns.append(Column(heading, name, unit, cells, where, decimal_comma=delimiter != ","))
    return columns


def split_unit(heading: str) -> tuple[str, str]:
    """Name and unit of a heading: `cw [A]` and `cw_A` alike; "" where there is no unit."""
    name, unit = split_heading(heading)
    if unit is not None:
        return name, {"°": "deg", "µs": "us"}.get(unit, unit)
    stem, _, ending = name.rpartition("_")
    return (stem, ending) if stem and ending in ENDINGS else (name, "")


def columns_in(
    path: Path, columns: Collection[Column], units: Collection[str], what: str, example: str
) -> list[Column]:
    """All columns, each in one of `units`; InputError for one in another unit, or if there are none."""
    for column in columns:
        if column.unit not in units:
            unit = f"is in {column.unit!r}" if column.unit else "has no unit"
            raise InputError(
                f"column {column.heading!r} {unit}; {what} are in {' or '.join(units)}: "
                f"convert it and head it as in {example!r}",
                column.where,
            )
    if not columns:
        raise InputError(f"it has no column with {what}; head one as in {example!r}", str(path))
    return list(columns)


def without_readings_of(columns: Collection[Column], ending: str) -> list[Column]:
    """The columns but those that another report is about: a module records `T_acceleration_x` and `T_current` together.

    `ending` is what their names end with, as a regular expression. Where there is nothing else, all are kept: the
    report says then what it would have.
    """
    kept = [column for column in columns if not re.search(rf"_{ending}$", column.name)]
    return kept if any(column.name.lower() not in ("time", "t") for column in kept) else list(columns)


def names_of(files: Sequence[Path]) -> list[str]:
    """What to call each file: its name without the ending, with its folder where another has the same name."""
    stems = [path.stem for path in files]
    return [
        stem if stems.count(stem) == 1 else path.with_suffix("").as_posix()
        for stem, path in zip(stems, files, strict=True)
    ]


def read_toml(path: Path) -> dict[str, Any]:
    """A TOML file; InputError with its line where it is none."""
    table, _ = toml_file.read_toml(path)
    return table
