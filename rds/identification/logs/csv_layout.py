"""How a text table is laid out: encoding, delimiter, decimal sign, where its data begin, headings and units.

Recorders write preambles, comments, a row of units, `;` with decimal commas, a mark before the first byte. The layout
is that under which most lines read as rows of numbers.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from pathlib import Path

from rds.core.errors import InputError
from rds.identification.logs.csv_cells import (
    BLANKS,
    DELIMITERS,
    are_numbers,
    has_unit,
    is_comment,
    is_number,
    not_in_utf_8,
    split,
    stamped,
)
from rds.identification.logs.csv_headings import (
    FEW,
    alternates,
    are_units,
    heading_cells,
    headings_above,
    labelled_headings,
    of_rigol,
)
from rds.identification.logs.csv_stamps import CLOCK, DATE, is_american, is_stamp, uniform_cell

HEAD = 1 << 16  # bytes looked at
_SETTINGS = 40  # lines beside which an oscilloscope says how it was set
_OTHER_MARK = re.compile(r"\d(;|\t)[+-]?\d")  # between cells that are no cells of commas or blanks
_TREND = re.compile(r"\d\d:\d\d:\d\d;\d{1,6},")  # a time in a trend of Rockwell's Studio 5000
_SCOPE_ROWS = ("SymbolComment ", "Data-Type ", "SampleTime[ms] ")  # of TwinCAT's scope, with blanks between the cells
_FEW_NULLS = 0.2  # share of a text's bytes
_CONTROLS = re.compile(rb"[\x01-\x06\x0e-\x1a\x1c-\x1f]")  # which no text has


@dataclass(frozen=True)
class Layout:
    """What a reader must know of a text table; `first` is the line, from 0, of the first row of data."""

    encoding: str
    delimiter: str
    decimal: str
    first: int
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    words: frozenset[int]  # columns whose cells are no numbers
    dates: Mapping[int, bool]  # columns of dates and times of day: whether their first one says its zone
    announced: int | None = None  # samples, where a comment says how many there should be
    times: tuple[int, ...] = ()  # columns that hold the times of the columns after them
    ragged: bool = False  # channels end one after another, and rows with them
    clocks: frozenset[int] = frozenset()  # which of the dates are times of day alone
    counted: tuple[float, float] | None = None  # samples are counted, in a column `time` or by row: time of first, step
    passed: str = ""  # a line above the data that has numbers in it, too
    scaled: tuple[str, ...] = ()  # channels of which nothing tells whether their numbers are scaled
    torn: tuple[str, ...] = ()  # of columns for which the heading and the row of units say different units
    beside: int = 0  # columns at the left that hold the recorder's settings beside the samples
    surplus: tuple[str, ...] = ()  # headings below which no cells stand
    american: frozenset[int] = frozenset()  # dates of which nothing tells whether the day or the month is first
    short: str = ""  # a line above the data that has fewer cells than the rows, where no other line names the columns


def sniff(path: Path, delimiter: str | None = None, decimal: str | None = None) -> Layout:
    """The layout of a text file; what is given is not guessed. InputError where there is no table of numbers."""
    lines, encoding = _head(path)
    choices = [delimiter] if delimiter else _worth_trying(lines)
    quoted = any('"' in line for line in lines)  # a comma may then be both; "1,234" is 1234 to many, so never by itself
    best: tuple[float, int, str, str, int] | None = None
    for mark in choices:
        for point in [decimal] if decimal else [".", ","]:
            if mark == point and not (decimal and quoted):
                continue
            first, width, score = _data(lines, mark, point)
            # more numbers is better; then the delimiter that comes first in the table, then the decimal point
            if score and (best is None or score > best[0]):
                best = (score, width, mark, point, first)
    if (beside := _of_tektronix(lines, encoding)) is not None:
        return beside
    if best is not None and quoted and (broken := _broken(lines[best[4] :])):
        what = f"a cell in quotation marks goes on in the next line ({broken[:40]!r})"
        cure = 'pandas.read_csv(FILE).replace(r"\\s*\\n\\s*", "", regex=True).to_csv("log.csv", index=False)'
        raise InputError(f"{what}; take the line breaks out, in Python by `{cure}`", str(path))
    if any(line.startswith("Header:") for line in lines) and any(_TREND.search(line) for line in lines):
        what = "it is a trend of Studio 5000, whose times have a semicolon before the fraction"
        cure = "sed -E 's/(:[0-9]{2});([0-9]+),/\\1.\\2,/' FILE > log.csv"
        raise InputError(f"{what}; put points there: `{cure}`", str(path))
    if best is None:
        shown = next((line for line in lines if line.strip()), "")
        remedy = "it needs columns of numbers, separated by commas, semicolons, tabs, bars or spaces"
        told = [line.strip() for line in lines if line.strip()]
        if all(line.count('"') == 2 and line[0] == line[-1] == '"' for line in told):
            remedy = "each line as a whole stands in quotation marks; take them off: `tr -d '\"' < FILE > log.csv`"
        elif quoted and decimal is None:
            remedy += '; for decimal commas in quotation marks say decimal = "comma" under [table]'
        if shown.lstrip().startswith(("{", "[{")):
            what, how = ("it is", "") if shown.lstrip().startswith("[") else ("its lines are", ", lines=True")
            remedy = f"{what} JSON: in Python `pandas.read_json(FILE{how}).to_csv('log.csv', index=False)`"
        if any(all(map(has_unit, cells)) for line in told for cells in [split(line, ",")[1:]] if cells):
            remedy = (
                "each cell has its unit in it: export the numbers alone, with the unit in the heading, as in pos [mm]"
            )
        if any(are_numbers(line.split(":")) for line in lines):
            remedy += "; its cells seem to stand between colons: export it with semicolons between them"
        raise InputError(f"no lines of numbers were found in it (it begins {shown[:60]!r}); {remedy}", str(path))
    _, width, mark, point, first = best
    if mark == " " and (
        labelled_headings(lines[:first], str.split) is not None or any(line.startswith(_SCOPE_ROWS) for line in lines)
    ):
        what = "its channels are headed by labels, and blanks stand between its cells, so that an empty one is lost"
        raise InputError(f"{what}; export it with semicolons between them (TwinCAT's scope asks for that)", str(path))
    whole = lines
    found_heads = labelled_headings(lines[:first], lambda line: split(line, mark)) if mark != " " else None
    labelled = found_heads is not None
    surplus: tuple[str, ...] = ()
    if found_heads is None:
        first = _with_faulty_rows(lines, first, mark, point, width)
        lines, surplus = _cut_heading(lines, first, mark, point, width)
        found_heads = headings_above(lines, first, mark, point, width)
    names, units, times, scaled, torn = found_heads
    width = len(names)
    if mark == "," and not labelled and first > 0:
        _refuse_decimal_commas(split(lines[first - 1], mark), width, path)
    if labelled:  # most rows may be shorter, as channels end one after another
        first = _below_labels(lines, first, mark, point, width)
    body = [cells for line in lines[first:] if len(cells := split(line, mark)) == width and not is_comment(line)]
    if stamp := stamped(body[:FEW], point):
        what = f"a terminal's time stamp stands before each line ({stamp!r}), and its first column cannot be read; "
        cut = f"cut {len(stamp)} characters off: `cut -c{len(stamp) + 1}- FILE > log.csv`"
        raise InputError(f"{what}switch the stamps off there, or {cut}", str(path))
    top = [uniform_cell(cell) for row in body[:1] for cell in row]
    stamps = {i: found for i, cell in enumerate(top) if (found := DATE.fullmatch(cell))}
    clocks = frozenset(i for i, cell in enumerate(top) if CLOCK.fullmatch(cell))
    dates = {i: bool(stamp["zone"]) for i, stamp in stamps.items()} | dict.fromkeys(clocks, False)
    words = frozenset(
        i
        for i in range(width)
        if i not in dates
        and body
        and not any(is_number(row[i], point) for row in body)
        and any(row[i].lower() not in BLANKS for row in body)
    )
    ends = [row[-1] for row in body[:FEW] if row[-1].rstrip("];").lower() not in BLANKS]
    if mark != ";" and width - 1 in words and ends and all(is_number(cell.rstrip("];"), point) for cell in ends):
        what = (
            "its rows end in ';', as a matrix is typed in MATLAB, so that its first row and last column cannot be read"
        )
        marks = "[];" if any(line.lstrip().startswith("[") for line in lines[first - 1 :]) else ";"
        raise InputError(f"{what}; take the marks off: `tr -d '{marks}' < FILE > log.txt`", str(path))
    times = times or (tuple(range(0, width, 2)) if alternates(units) else ())
    announced = _announced(lines[:first])
    numbers = [i for i in range(width) if any(is_number(row[i], point) for row in body[:FEW])]
    passed = "" if labelled else _passed(lines[:first], mark, point, width, numbers)
    counted = None
    if found_rigol := of_rigol([line for line in whole[:first] if line.strip()], names, units):
        names, units, counted = found_rigol
        surplus = ()
    return Layout(
        encoding,
        mark,
        point,
        first,
        names,
        units,
        words,
        dates,
        announced,
        times,
        labelled,
        clocks,
        counted,
        passed,
        scaled,
        torn,
        surplus=surplus,
        american=frozenset(i for i in stamps if is_american(body[0][i])),
        short=_short_heading(lines[:first], mark, point, names),
    )


def _short_heading(above: Sequence[str], delimiter: str, decimal: str, names: Sequence[str]) -> str:
    """The line above the data, if it has two words or more but fewer cells than the rows, and no column has a name."""
    line = next((line for line in reversed(above) if line.strip()), "")
    cells = split(line, delimiter)
    named = any(name != f"column {i + 1}" for i, name in enumerate(names))
    fits = 1 < len(cells) < len(names) and all(cell and not is_number(cell, decimal) for cell in cells)
    return line if fits and not named and not is_comment(line) else ""


def _broken(lines: Sequence[str]) -> str:
    """The first of two lines in turn that a cell in quotation marks stands across; "" where there is none."""
    pairs = pairwise(lines)
    return next((one for one, two in pairs if one.count('"') % 2 and two.startswith('"') and two.count('"') % 2), "")


def _refuse_decimal_commas(heading: Sequence[str], width: int, path: Path) -> None:
    """InputError where each name of a heading, or all but one, has two cells of the rows, as of decimal commas."""
    count = len(heading)
    if (width == 2 * count > 2 or width == 2 * count - 1 > 3) and all(name and name[0].isalpha() for name in heading):
        what = f"its heading has {count} names, and its rows have {width} cells: decimal commas seem to stand there "
        what += "between commas, where nobody can tell them apart"
        raise InputError(f"{what}; export it with decimal points, or with semicolons between the cells", str(path))


def _worth_trying(lines: Sequence[str]) -> list[str]:
    """The delimiters that are in the lines, and one that is not: all those find a single column."""
    present = [mark for mark in DELIMITERS.values() if any(mark in line for line in lines)]
    absent = [mark for mark in DELIMITERS.values() if mark not in present]
    return [mark for mark in DELIMITERS.values() if mark in present or mark in absent[:1]]


def in_rows(what: str, path: Path) -> InputError:
    """The error that the signals of a table stand in rows, as NumPy writes an array of (signals, samples)."""
    return InputError(
        f"{what}: its signals stand in rows, as it seems, and a sample in a column; turn the table round, in Python by "
        "`numpy.savetxt('log.csv', numpy.loadtxt(FILE, delimiter=',').T, delimiter=',', header='t [s],u [V],y [mm]')`",
        str(path),
    )


def _head(path: Path) -> tuple[list[str], str]:
    with open(path, "rb") as stream:
        data = stream.read(HEAD)
        whole = not stream.read(1)
    if not data.strip():
        raise InputError("it is empty; record it again or take another copy", str(path))
    for mark, name in ((codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16")):
        if data.startswith(mark):
            raise InputError(
                f"it is text in {name}; save it as CSV (UTF-8)", str(path)
            )  # read_csv turned it into UTF-8
    if nulls := data.count(b"\0"):
        if nulls < _FEW_NULLS * len(data) and b"\n" in data and not _CONTROLS.search(data):
            what = f"it has {nulls} null bytes between its text, as programs in C write the end of each"
            raise InputError(f"{what}; take them off: `tr -d '\\000' < FILE > log.csv`", str(path))
        raise InputError("it is not text (it has null bytes); is its ending right?", str(path))
    encoding = "utf-8"
    try:
        text = codecs.getincrementaldecoder("utf-8")().decode(data, whole)
        if not whole and (line := not_in_utf_8(path)):
            if not text.isascii():
                what = f"it begins in UTF-8, and has bytes there that are none: {line[1][:40]!r}"
                raise InputError(f"{what}; repair or remove the line", f"{path}, line {line[0]}")
            encoding = "cp1252"
    except UnicodeDecodeError:
        encoding, text = "cp1252", data.decode("cp1252", errors="replace")
    if "\r" in text and "\n" not in text:
        raise InputError("its lines end in a carriage return alone, as on old Macs; save it with line feeds", str(path))
    if not whole and "\n" not in text:
        raise in_rows(f"its first line has more than {HEAD} bytes", path)
    # not splitlines(): a form feed ends no line for the reader of the rows
    lines = [line.rstrip("\r") for line in text.removeprefix("\ufeff").split("\n")]
    return (lines if whole or len(lines) < 2 else lines[:-1]), encoding


def _data(lines: Sequence[str], delimiter: str, decimal: str) -> tuple[int, int, float]:
    """First line and width of the rows of numbers, and how many numbers they have (0: none).

    The rows have the width that most have, and numbers where nearly all of them do: a line of a preamble such as
    `gain;2.5` is none of them.
    """
    rows: dict[int, list[tuple[int, list[bool]]]] = {}  # by width: line, and which cells are a number or blank
    numbers: dict[int, int] = {}
    for number, line in enumerate(lines):
        if line.strip() and not is_comment(line):
            cells = split(line, delimiter)
            kinds = [is_number(cell, decimal) or is_stamp(cell) for cell in cells]
            blanks = sum(cell.lower() in BLANKS for cell in cells)
            if delimiter in ", " and _OTHER_MARK.search(line):
                continue
            if any(kinds) and sum(kinds) + blanks >= len(cells) / 2:
                fits = [kind or cell.lower() in BLANKS for kind, cell in zip(kinds, cells, strict=True)]
                rows.setdefault(len(cells), []).append((number, fits))
                numbers[len(cells)] = numbers.get(len(cells), 0) + sum(kinds)
    if not rows:
        return 0, 0, 0.0
    width = max(rows, key=lambda w: (len(rows[w]), -rows[w][0][0]))
    found = rows[width]
    usual = [sum(fits[i] for _, fits in found) > 0.9 * len(found) - 1 for i in range(width)]
    first = next((n for n, fits in found if all(f or not u for f, u in zip(fits, usual, strict=True))), found[0][0])
    while first and _is_blank(split(lines[first - 1], delimiter), width):
        first -= 1  # the first sample is a row of NaN
    return first, width, float(numbers[width])


def _is_blank(cells: Sequence[str], width: int) -> bool:
    """Whether a row has nothing but NaN."""
    said = [cell.rstrip(";").lower() for cell in cells]
    return len(cells) == width and all(cell.lstrip("+-") == "nan" for cell in said)


def _with_faulty_rows(lines: Sequence[str], first: int, delimiter: str, decimal: str, width: int) -> int:
    """The first row below the heading, where rows right above `first` have a word in place of a number."""
    at = first
    while at > 0 and not is_comment(lines[at - 1]):
        cells = split(lines[at - 1], delimiter)
        if len(cells) != width or not any(is_number(cell, decimal) for cell in cells) or are_units(cells):
            break
        at -= 1
    heading = heading_cells(lines[at - 1], delimiter, width) if at > 0 else None
    return at if heading is not None else first


def _passed(above: Sequence[str], delimiter: str, decimal: str, width: int, numbers: Sequence[int]) -> str:
    """The last line above the data with numbers where they have, or of numbers alone, two or more; "" for none."""
    for line in reversed(above):
        cells = split(line, delimiter)
        if len(cells) == width and len(numbers) > 1 and all(is_number(cells[i], decimal) for i in numbers):
            return line
        if are_numbers([cell for cell in cells if cell]) or are_numbers(line.split()):
            return line  # perhaps the first row, with a constant beside it
    return ""


def _of_tektronix(lines: Sequence[str], encoding: str) -> Layout | None:
    """The layout of a channel that a TDS or TBS oscilloscope saved, its settings beside the first samples.

    Record Length,2.500000e+03,,  -0.0125,  -3.60,
    Sample Interval,1.000000e-05,,  -0.01249,  -3.58,
    """
    rows = [split(line, ",") for line in lines[:_SETTINGS]]
    if not rows or rows[0][:1] != ["Record Length"] or len(rows[0]) < 5 or not is_number(rows[0][1], "."):
        return None
    settings = {row[0]: row[1] for row in rows if len(row) > 1 and row[0]}
    first = next((n for n, row in enumerate(rows) if all(is_number(cell, ".") for cell in row[3:5])), None)
    if first is None:
        return None
    width = len(rows[0])
    names = [
        "setting",
        "value",
        "blank",
        "time",
        settings.get("Source", "channel"),
        *(f"column {i + 1}" for i in range(5, width)),
    ]
    units: list[str | None] = [None] * width
    units[3:5] = settings.get("Horizontal Units") or None, settings.get("Vertical Units") or None
    length = float(rows[0][1])
    announced = int(length) if isfinite(length) else None
    words = frozenset((0, 1))
    return Layout(encoding, ",", ".", first, tuple(names), tuple(units), words, {}, announced, beside=3)


def _cut_heading(
    lines: list[str], first: int, delimiter: str, decimal: str, width: int
) -> tuple[list[str], tuple[str, ...]]:
    """The lines with the heading as wide as the rows, where it is wider, and which of its cells that leaves out.

    LabVIEW heads a column of comments that has no cells, an oscilloscope those of start and step.
    """
    if first == 0 or delimiter == " ":
        return lines, ()
    cells = split(lines[first - 1], delimiter)
    wider = len(cells) > width
    while cells and not cells[-1]:
        cells.pop()
    below = [split(line, delimiter) for line in lines[first : first + FEW] if line.strip() and not is_comment(line)]
    ended = bool(below) and all(row[-1] == "" for row in below)
    own, surplus = cells[: width - ended], cells[width - ended :]
    if (
        not wider
        or len(cells) < width - ended
        or not all(own)
        or len(set(cells)) < len(cells)
        or any(is_number(cell, decimal) for cell in cells)
    ):
        return lines, ()
    found = [f'"{cell}"' if delimiter in cell else cell for cell in own]
    return [*lines[: first - 1], delimiter.join(found), *lines[first:]], tuple(surplus)


def _below_labels(lines: Sequence[str], first: int, delimiter: str, decimal: str, width: int) -> int:
    """The first whole row of numbers, at `first` or before it."""
    for number, line in enumerate(lines[:first]):
        cells = split(line, delimiter)
        if len(cells) >= width and all(is_number(cell, decimal) for cell in cells if cell.lower() not in BLANKS):
            return number
    return first


def _announced(lines: Sequence[str]) -> int | None:
    for line in lines:
        found = re.search(r"\b(?:samples|rows|points|records)\b\W{0,3}(\d+)", line, re.IGNORECASE)
        if found:
            return int(found[1])
    return None
