"""Names and units of the columns of a text table, as recorders and drives head them.

Beside `name [unit]` these are: `name/unit`, `name in unit`, `name, unit` and `name {unit}`; and tables in which each
channel has a column of times before it, headed by rows of label and value in turn (`Name;ActPos;Name;SetPos`,
`Unit;mm;Unit;mm`), as TwinCAT's scope exports them, or NI's SignalExpress (`Channel name,"Force"`, `Interval,0.0005`).
TwinCAT's scope also gives channels one column of times together (`Name;ActPos;SetPos;Name;CmdVolt`), all of them where
they have one rate (`Name;ActPos;CmdVolt`). Mitsubishi's drives head their times by the unit: `ms`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rds.identification.logs.csv_cells import BLANKS, COMMENTS, is_comment, is_number, split
from rds.identification.logs.units import dimension, plain, unit_of_name
from rds.results.units import split_heading

Split = Callable[[str], list[str]]
_FIRST_INDEX = re.compile(r"\S\s+[\[(]1[\])]\s*$")
_OTHER_INDEX = re.compile(r"\S\s+[\[(](?!1[\])])\d+[\])]\s*$")
_BRACES = re.compile(r"(?P<name>.*?)\s*\{(?P<unit>[^{}]*)\}\s*")
# what stands in brackets behind a name as a unit does, and says which of two signals of one name it is
_NO_UNITS = (
    *("setpoint", "set", "demand", "desired", "target", "commanded", "command", "reference", "ref", "soll"),
    *("measured", "actual", "act", "feedback", "ist"),
)
_WIDE_BRACKETS = str.maketrans("（）［］｛｝", "()[]{}")  # of Chinese and Japanese keyboards
_BETWEEN = re.compile(r"\s*[/,]\s*|\s+[iI][nN]\s+")  # a name and its unit
_SCALES = (("scalefactor", "1"), ("offset", "0"), ("unit scalefactor", "1"), ("unit offset", "0"))
_LEAST_TIMES = 2  # columns of times, but in an export of TwinCAT's scope
_SCOPE = re.compile(r"start ?time of (export|record)", re.IGNORECASE)  # TwinCAT's, whose times are in ms
_PAIR_NAMES, _PAIR_UNIT = ("name", "channel name"), "unit"
_PAIR_TIMES = {"sampletime[ms]": "ms", "interval": "s"}  # which label says in which unit the times are
# an oscilloscope's first line: `X,CH1,CH2,Start,Increment`, with units, start and step in the second one; of newer ones
# `CH1A,CH2V,t0 =-6.5e+00, tInc = 8.0e-06`
_RIGOL = re.compile(r"(X,)?(CH\d,)+Start,Increment,?\s*")
_NEWER_RIGOL = re.compile(r"(Time\(s\),)?((?:CH\d+[VAW],)+)\s*t0\s*=([^,]*),\s*tInc\s*=([^,]*),?\s*")
_TIMES_ALONE = ("ms", "us", "µs", "μs")  # headings of a time by its unit; `s` may be a way, `min` a least one
FEW = 20  # rows of data that are looked at for how they end
# what stands in a row of units beside those of `units.py`
_OTHER_UNITS = re.compile(
    r"k?W|[°]?C|Deg C|degC|k?Hz|k?g|kgf|J|[AW]h|M?Pa|bar|N[.*]mm|(m|rad|deg)/s(\^2|²|2)|#|[kM]?Ohm|Ω"
)
_TIME_NAMES = ("time", "zeit", "date")
_UNIT_LABELS = ("unit", "units", "einheit", "einheiten")


class Headings(NamedTuple):
    """`times`: which columns hold the times of the columns after them; none where there is one time, or none.

    `torn`: columns whose heading says another unit than the row of units.
    `scaled`: channels with a factor or an offset, of which the file does not tell whether its numbers have it.
    """

    names: tuple[str, ...]
    units: tuple[str | None, ...]
    times: tuple[int, ...] = ()
    scaled: tuple[str, ...] = ()
    torn: tuple[str, ...] = ()


def alternates(units: Sequence[str | None]) -> bool:
    """Whether these units of columns are those of times and channels in turn, two channels or more."""
    of = [dimension(unit) if unit else None for unit in units]
    return len(of) >= 4 and len(of) % 2 == 0 and set(of[::2]) == {"time"} and not {"time", None} & set(of[1::2])


def name_and_unit(cell: str) -> tuple[str, str | None]:
    """Name and unit of a heading; None where it gives none. Without brackets a unit must be one that is known."""
    cell = cell.translate(_WIDE_BRACKETS)
    name, unit = split_heading(cell)
    if unit is not None and unit.casefold() in _NO_UNITS:
        return cell.strip(), None  # `x (setpoint)`
    if unit is not None and dimension(unit) is None:
        own, known = split_heading(name)
        if known is not None and dimension(known) is not None:
            return f"{own} ({unit})", known  # `pos [mm] (filtered)`
    if unit is not None or name in _TIMES_ALONE:
        return name, unit or name
    if cell.startswith("in ") and dimension(cell[3:]) == "time":
        return "time", cell[3:].strip()  # Rohde & Schwarz: `in s,C1 in V`
    if braced := _BRACES.fullmatch(cell):
        return braced["name"], braced["unit"].strip()
    for between in _BETWEEN.finditer(cell) if dimension(cell) is None else ():  # `mm/s` is no mm in s
        before, after = cell[: between.start()].strip(), cell[between.end() :].strip()
        if before and dimension(before) is None and dimension(after) is not None:
            return before, after
    return name, None


def indexed(cells: Sequence[str]) -> set[str]:
    """The headings in which `(1)` is the number of a signal, as in `pos (1)` beside `pos (2)`, and no unit."""
    others = any(_OTHER_INDEX.search(cell) for cell in cells)
    return {cell for cell in cells if others and _FIRST_INDEX.search(cell)}


def labelled_headings(lines: Sequence[str], cells_of: Split) -> Headings | None:
    """The headings of a table whose channels have times of their own, by rows of labels; None of any other table.

    A label stands above each column of times: `Name;ActPos;Name;CmdVolt`, or `Name;ActPos;CmdVolt;Name;Torque`.
    """
    rows: dict[str, list[str]] = {}
    times: tuple[int, ...] = ()
    scope = False
    for line in lines:
        cells = cells_of(line)
        label = cells[0].casefold() if cells else ""
        scope |= _SCOPE.fullmatch(label) is not None
        if label in _PAIR_NAMES and not times:
            while len(cells) > 1 and not cells[-1]:  # a delimiter at the end
                cells.pop()
            found = tuple(i for i, cell in enumerate(cells) if cell.casefold() == label)
            if len(found) < (1 if scope else _LEAST_TIMES) or len(cells) - 1 in found:
                continue  # `Name;Project`, above the table
            times, rows[label] = found, cells
    if not times:
        return None
    width = len(next(iter(rows.values())))
    labels = set()
    for line in lines:
        cells = cells_of(line)
        labels |= {cell.casefold() for cell in cells[:1]}
        if len(cells) >= width and len({cells[i] for i in times}) == 1:
            rows.setdefault(cells[0].casefold(), cells[:width])
    names = next(rows[label] for label in _PAIR_NAMES if label in rows)
    channels = [name for i, name in enumerate(names) if i not in times]
    if len(set(channels)) < len(channels):
        return None
    units = [_labelled_unit(cell) for cell in rows.get(_PAIR_UNIT, [""] * width)]
    time = next((unit for label, unit in _PAIR_TIMES.items() if label in labels), "ms" if scope else None)
    return Headings(
        names=tuple(f"time of {names[i + 1]}" if i in times else names[i] for i in range(width)),
        units=tuple(time if i in times else units[i] for i in range(width)),
        times=times,
        scaled=tuple(
            name
            for i, name in enumerate(names)
            if i not in times and any(rows[label][i] not in ("", usual) for label, usual in _SCALES if label in rows)
        ),
    )


def _labelled_unit(cell: str) -> str | None:
    """The unit in `mm`, `[mm]`, `(mm)` or TwinCAT's `V (Voltage)`; its `(None)` is none."""
    own, _, remark = cell.partition("(")
    unit = own.strip("[] ") or remark.strip("[]() ")
    return None if unit.casefold() in ("", "none") else unit


def of_rigol(
    above: Sequence[str], names: tuple[str, ...], units: tuple[str | None, ...]
) -> tuple[tuple[str, ...], tuple[str | None, ...], tuple[float, float] | None] | None:
    """Names, units, and time of the first sample and step, of a table of Rigol's that has no time; None of another.

    `above`: the lines above the data. The samples are counted in a column, here called `time`, or stand alone. Where
    there is a time, its step is None.
    """
    if above and (newer := _NEWER_RIGOL.fullmatch(above[0])):
        channels = newer[2].rstrip(",").split(",")
        cells, own = [channel[:-1] for channel in channels], [channel[-1] for channel in channels]
        told = [newer[3], newer[4]]
        if newer[1]:
            cells, own = ["time", *cells], ["s", *own]
    elif len(above) > 1 and _RIGOL.fullmatch(above[0]):
        cells, own = above[0].split(","), [cell.strip() for cell in above[1].split(",")]
        found = cells.index("Start")
        cells, own, told = cells[:found], own[:found], own[found : found + 2]
        if cells[0] == "X" and own:
            cells[0], own[0] = "time", "s"
    else:
        return None
    try:
        first, step = map(float, told)
    except ValueError:
        return None
    counted = None if above[0].startswith("Time") else (first, step)
    rest = len(cells)
    return (
        (*cells, *(f"column {i + 1}" for i in range(rest, len(names)))),
        (*own, *units[rest:]),
        counted,
    )


def headings_above(lines: Sequence[str], first: int, delimiter: str, decimal: str, width: int) -> Headings:
    """Names and units from the lines above the data: headings, perhaps with a row of units below them."""
    noted = [_note(line, delimiter, width) for line in lines[:first]]
    below_what = next((i for i in range(first) if len(split(lines[i], delimiter)) == width), first)
    noted[: below_what + 1] = [None] * len(noted[: below_what + 1])  # the first of such rows has the names
    above = [line for line, note in zip(lines, noted, strict=False) if line.strip() and note is None][-2:]
    below = [split(line, delimiter) for line in lines[first : first + FEW] if line.strip() and not is_comment(line)]
    ended = bool(below) and all(cells[-1] == "" for cells in below)  # a delimiter ends each row, and perhaps no heading
    rows = [heading_cells(line + delimiter * ended, delimiter, width) for line in above]
    if ended and None in rows:
        rows = [found or heading_cells(line, delimiter, width) for found, line in zip(rows, above, strict=True)]
    units: list[str | None] = [None] * width
    heads = rows[-1] if rows else None
    if heads is not None and heads[0].strip("[]():").casefold() in _UNIT_LABELS and are_units(heads[1:]):
        heads = ["", *heads[1:]]  # a label, and no unit
    above_units = heads is not None and len(rows) > 1 and rows[-2] is not None and _seem_units(heads, rows[-2], decimal)
    if heads is not None and above_units:
        units = [split_heading(cell)[1] or cell.strip("[]()") or None for cell in heads]
        heads = rows[-2]
    filled = {i for cells in below if len(cells) == width for i in range(width) if cells[i].lower() not in BLANKS}
    # above blanks alone, numbers are notes
    numbers = {i for i, cell in enumerate(heads or ()) if is_number(cell, decimal)}
    if heads is None or (numbers & filled and not above_units):
        return Headings(tuple(f"column {i + 1}" for i in range(width)), tuple(units))
    names: list[str] = []
    torn: list[str] = []
    numbered = indexed(heads)
    for i, cell in enumerate(heads):
        name, unit = (cell, None) if cell in numbered else name_and_unit(cell.strip('"'))
        if units[i] is not None and unit is not None and dimension(unit) is None:
            name, unit = cell.strip('"'), None  # `X(CH1)` above `Volt`
        if unit is None and units[i] and (own := unit_of_name(name)) and dimension(own) == dimension(units[i] or ""):
            unit = own  # `time_ms` above `s`
        names.append(f"column {i + 1}" if i in numbers - filled or not name else name)
        if unit and units[i] and dimension(unit) and dimension(units[i] or "") and plain(unit) != plain(units[i] or ""):
            torn.append(f"{name} in {unit}, and {units[i]} below")
        units[i] = unit if unit is not None else units[i]
    for note in noted:
        if note is not None and note[0] in _UNIT_LABELS:
            units = [unit or own or None for unit, own in zip(units, ["", *note[1]], strict=True)]
    return Headings(tuple(names), tuple(units), torn=tuple(torn))


def _note(line: str, delimiter: str, width: int) -> tuple[str, list[str]] | None:
    """What a row below the headings notes of each signal, as Simulink's data inspector does: `,Units: mm,Units: V`."""
    label, *cells = split(line, delimiter) or [""]
    keys = {cell.partition(":")[0].strip().casefold() for cell in cells}
    if label or width < 2 or len(cells) != width - 1 or len(keys) != 1 or not all(":" in cell for cell in cells):
        return None
    return keys.pop(), [cell.partition(":")[2].strip() for cell in cells]


def heading_cells(line: str, delimiter: str, width: int) -> list[str] | None:
    """The cells of a row of headings, a remark perhaps; None where they are not as many as the columns."""
    text = line.lstrip()
    for mark in COMMENTS:
        text = text.removeprefix(mark)
    cells = split(text, delimiter)
    if delimiter == " " and len(cells) != width:  # `time [s]  position [mm]`
        cells = [cell.strip() for cell in re.findall(r"\S+(?:\s*[\[(][^\])]*[\])])?", text)]
    if delimiter == " " and len(cells) != width:  # `Time   Encoder 1 Pos   Control Effort`
        cells = re.split(r"\s{2,}|\t", text.strip())
    return cells if len(cells) == width else None


def are_units(cells: Sequence[str]) -> bool:
    """Whether all that stands in a row are units, each a known one."""
    given = [cell.strip("[]() ") for cell in cells if cell.strip("[]()- ")]
    return bool(given) and all(dimension(cell) is not None for cell in given)


def _seem_units(cells: Sequence[str], names: Sequence[str], decimal: str) -> bool:
    """Whether a row below the row `names` is one of units, of which some may be unknown: half of them are none."""
    if are_units(cells):
        return True
    given = [cell for cell in cells if cell.strip("[]()- ")]
    known = sum(dimension(cell.strip("[]() ")) is not None for cell in given)
    other = sum(_OTHER_UNITS.fullmatch(cell.strip("[]() ")) is not None for cell in given)
    words = all(not is_number(cell, decimal) for cell in (*cells, *names)) and all(names)
    # a row of names below a title: `t V mm` names its columns by their units
    words &= not any(cell.strip("[]() ") == "t" or cell.casefold().startswith(_TIME_NAMES) for cell in given)
    return words and known > 0 and 2 * (known + other) >= len(given)
