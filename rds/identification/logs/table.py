"""A file of logged data as columns of numbers, before anybody has said what they mean."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.options import check_known
from rds.identification.logs.csv_cells import has_unit
from rds.identification.logs.csv_headings import name_and_unit
from rds.identification.logs.log import Finding

_DATE = re.compile(r"\d{1,4}[./-](\d{1,2}|[^\W\d_]{3,9})[./-]\d{1,4}(?!\d)")
DATE_REMEDY = (
    "write dates as 2024-05-01 12:00:00.001 (of others nobody knows which is the day), times of day as 12:00:00.001, "
    "or the time in s"
)
_OF_DAY = re.compile(r"(\d+ days? )?\d{1,2}:\d\d\b")
_POINT = re.compile(r"[+-]?[0-9]+\.[0-9]+")
_OTHER_THOUSANDS = re.compile(r"[+-]?\d{1,3}([.'\u2019\u00a0\u202f ])\d{3}(\1\d{3})*(,\d+|\.\d+)?")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+(\.\d+)?")
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Column:
    """One column: float64, with NaN where the file has no number.

    `unit` is None where the file gives none. `time` (s) is there where the column has times of its own (a signal on
    a bus). `text` is the first cell that is no number, with its row, in a column that holds words.
    """

    name: str
    unit: str | None
    values: np.ndarray
    time: np.ndarray | None = None
    text: tuple[int, str] | None = None


@dataclass(frozen=True)
class Table:
    """What a file holds. `constants` are single numbers beside the columns, as MAT files have them."""

    path: Path
    format: str  # csv, codesys, halscope, labelled, labview, mat, parquet, can, mdf
    columns: Mapping[str, Column]
    constants: Mapping[str, float] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()  # about the file itself: cut, comments inside, encoding
    sha256: str = ""

    @property
    def rows(self) -> int:
        """The length of the columns; of a bus log, of the longest."""
        return max((len(column.values) for column in self.columns.values()), default=0)

    @property
    def own_times(self) -> bool:
        """Whether each column has times of its own, as the signals on a bus."""
        return any(column.time is not None for column in self.columns.values())

    def column(self, name: str, place: str) -> Column:
        """The column called `name`, which may be its heading with the unit; InputError at `place`, with the names there
        are, for another or one of words.
        """
        bare, unit = name_and_unit(name)
        if name not in self.columns and unit is not None and bare in self.columns and self.columns[bare].unit == unit:
            name = bare
        if name not in self.columns:
            try:
                check_known([name], self.columns, self.path.name)
            except InputError as error:
                raise InputError(str(error).replace("option", "column", 1), place) from None
        found = self.columns[name]
        if found.text is not None:
            row, cell = found.text
            raise InputError(
                f"column {name!r} holds {cell!r:.60} in its data row {row + 1}; {remedy(cell)}",
                str(self.path),
            )
        return found


def remedy(cell: str) -> str:
    """What to do about a cell that is no number."""
    cell = cell.strip()
    if _DATE.match(cell):
        return DATE_REMEDY
    if _OF_DAY.match(cell):
        return "write times of day as 13:00:00.001 (24 hours, a point before the fraction), spans as s"
    if _POINT.fullmatch(cell):  # no number where decimal commas were found, or said
        return (
            "every cell must be a number: export the file without a sign that parts the thousands, and with the same "
            "decimal sign in every cell"
        )
    if _OTHER_THOUSANDS.fullmatch(cell):
        return "every cell must be a number: export the file without a sign that parts the thousands"
    if _THOUSANDS.fullmatch(cell):
        return (
            "every cell must be a number: if this comma parts the thousands, export the file without it; if it is a "
            'decimal comma, say decimal = "comma" under [table] in a map'
        )
    if _DECIMAL_COMMA.fullmatch(cell):
        return 'every cell must be a number: if this is a decimal comma, say decimal = "comma" under [table] in a map'
    if has_unit(cell):
        return (
            "every cell must be a number: export the file without a unit in each cell, and put it into the heading, as "
            "in pos [mm]"
        )
    if cell.startswith("\u2212"):
        return "every cell must be a number: its minus sign is that of a word processor (U+2212); write - in its place"
    return (
        "every cell must be a number: repair it or choose another column; where such cells are emptied, "
        'blanks = "drop" in a map leaves their rows out'
    )


def since_first(stamps: np.ndarray) -> np.ndarray:
    """Dates (datetime64[ns], NaT where there is none) as s from the first one, exact to 1 ns; NaN for NaT."""
    known = np.flatnonzero(~np.isnat(stamps))
    if not len(known):
        return np.full(len(stamps), np.nan)
    return np.where(np.isnat(stamps), np.nan, (stamps - stamps[known[0]]).astype(np.int64) * 1e-9)
