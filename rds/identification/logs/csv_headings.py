"""Names and units of the columns of a text table, as recorders and drives head them.

Beside `name [unit]` these are: `name/unit`, `name in unit`, `name, unit` and `name {unit}`; the head of LabVIEW's .lvm
files, whose units stand in a row of their own; and tables in which each channel has a column of times before it, headed
by rows of label and value in turn (`Name;ActPos;Name;SetPos`, `Unit;mm;Unit;mm`), as TwinCAT's scope exports them, or
NI's SignalExpress (`Channel name,"Force"`, `Interval,0.0005`). Mitsubishi's drives head their times by the unit: `ms`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rds.identification.logs.units import dimension
from rds.results.units import split_heading

Split = Callable[[str], list[str]]
_BRACES = re.compile(r"(?P<name>.*?)\s*\{(?P<unit>[^{}]*)\}\s*")
_BETWEEN = re.compile(r"\s*[/,]\s*|\s+[iI][nN]\s+")  # a name and its unit
_LABVIEW, _LABVIEW_UNITS, _LABVIEW_TIME = "LabVIEW Measurement", "Y_Unit_Label", "X_Dimension"
_PAIR_NAMES, _PAIR_UNIT = ("name", "channel name"), "unit"
_PAIR_TIMES = {"sampletime[ms]": "ms", "interval": "s"}  # which label says in which unit the times are
_TIMES_ALONE = ("ms", "us", "µs", "μs")  # headings of a time by its unit; `s` may be a way, `min` a least one


class Headings(NamedTuple):
    """`paired`: every other column holds the times of the column after it."""

    names: tuple[str, ...]
    units: tuple[str | None, ...]
    paired: bool = False


def alternates(units: Sequence[str | None]) -> bool:
    """Whether these units of columns are those of times and channels in turn, two channels or more."""
    of = [dimension(unit) if unit else None for unit in units]
    return len(of) >= 4 and len(of) % 2 == 0 and set(of[::2]) == {"time"} and not {"time", None} & set(of[1::2])


def name_and_unit(cell: str) -> tuple[str, str | None]:
    """Name and unit of a heading; None where it gives none. Without brackets a unit must be one that is known."""
    name, unit = split_heading(cell)
    if unit is not None or name in _TIMES_ALONE:
        return name, unit or name
    if braced := _BRACES.fullmatch(cell):
        return braced["name"], braced["unit"].strip()
    for between in _BETWEEN.finditer(cell) if dimension(cell) is None else ():  # `mm/s` is no mm in s
        before, after = cell[: between.start()].strip(), cell[between.end() :].strip()
        if before and dimension(before) is None and dimension(after) is not None:
            return before, after
    return name, None


def labview_units(above: Sequence[str], split: Split, names: Sequence[str]) -> tuple[str | None, ...] | None:
    """The units of the columns `names` in a LabVIEW measurement file, by the lines above the data; None in another."""
    if not any(line.startswith(_LABVIEW) for line in above):
        return None
    units: list[str | None] = [None] * len(names)
    for line in above:
        label, *cells = split(line) or [""]
        if label == _LABVIEW_UNITS:
            units[1 : len(cells) + 1] = [cell or None for cell in cells[: len(names) - 1]]
        elif label == _LABVIEW_TIME and "Time" in cells:
            units[0] = "s"
    return tuple(units)


def paired_headings(above: Sequence[str], split: Split, width: int) -> Headings | None:
    """The headings of a table whose channels each have times of their own; None of any other table."""
    rows: dict[str, list[str]] = {}
    for line in above:
        cells = split(line)[:width]
        if width % 2 == 0 and len(cells) == width and len(set(cells[::2])) == 1:
            rows.setdefault(cells[0].casefold(), cells[1::2])
    named = next((rows[label] for label in _PAIR_NAMES if label in rows), None)
    if named is None or width < 4 or len(set(named)) < len(named):
        return None
    units = rows.get(_PAIR_UNIT, [""] * len(named))
    time = next((unit for label, unit in _PAIR_TIMES.items() if label in rows), None)
    return Headings(
        names=tuple(name for channel in named for name in (f"time of {channel}", channel)),
        units=tuple(unit for own in units for unit in (time, own.strip("[]() ") or None)),
        paired=True,
    )
