"""Text tables as columns of numbers, read in blocks: ten million rows cost the memory of their numbers.

Our own, because `pandas` reads a layout that it is told; here it is found, and a damaged row is named with its
line.
"""

from __future__ import annotations

import codecs
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.limits import LINE, lifted, refusal
from rds.core.progress import Progress
from rds.identification.logs.csv_cells import BLANKS, is_number, split
from rds.identification.logs.csv_layout import HEAD, Layout, in_rows, sniff
from rds.identification.logs.csv_stamps import rules, uniform
from rds.identification.logs.log import Finding, Gravity
from rds.identification.logs.table import DATE_REMEDY, Column, Table, since_first
from rds.identification.logs.units import factor, unit_of_name

_BLOCK = 1 << 22  # bytes
_TAIL = 1 << 14  # bytes at the end in which a cut is looked for
_REMARK = re.compile(rb"(?m)^[ \t]*(?:#|%|//|!).*(?:\n|\Z)")
_SPACES = re.compile(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)")
_DAY = 86400.0  # s
_WIDE, _TIMES_WIDER = 100, 10  # columns from which, and rows of which, a table lies on its side
_FILETIME = 1e16  # in steps of 100 ns since 1601: times in ms are below
_END = b"EOF"  # the last line of an export of TwinCAT's scope
_DOS_END = b"\x1a"  # of a text, on DOS and on instruments of that time
_SPELLED = (str.lower, str.upper, str.capitalize)
_NULLS = [" ", "NaN", "+Inf", "-Inf", *(spelled(word) for word in BLANKS for spelled in _SPELLED)]


def read_csv(
    path: Path, delimiter: str | None = None, decimal: str | None = None, progress: Progress | None = None
) -> Table:
    """The table in a text file. Raises InputError, with the line, for a row of another width than the others.

    A last line without its end is left out where it is shorter than the lines before it: the file was cut there.
    """
    with open(path, "rb") as stream:
        wide = stream.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    return _of_utf_16(path, delimiter, decimal, progress) if wide else _table(path, delimiter, decimal, progress)


def _of_utf_16(path: Path, delimiter: str | None, decimal: str | None, progress: Progress | None) -> Table:
    """The table in a text of two bytes a character, as spreadsheets save "Unicode text": by a copy in UTF-8."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        try:
            with (
                open(path, encoding="utf-16", newline="") as text,
                open(copy, "w", encoding="utf-8", newline="") as out,
            ):
                while part := text.read(_BLOCK):
                    out.write(part)
        except UnicodeError as error:
            raise InputError(
                f"it begins as text in UTF-16 and is none: {error}; take another copy", str(path)
            ) from error
        try:
            table = _table(copy, delimiter, decimal, progress)
        except InputError as error:
            where = (error.where or str(path)).replace(str(copy), str(path))
            raise InputError(str(error).removeprefix(f"{error.where}: "), where) from error
    said = Finding("encoding", "it is not UTF-8; it was read as utf-16")
    return replace(table, path=path, findings=(said, *table.findings))


def _read_as(layout: Layout) -> Finding:
    """That a file is no UTF-8, and what to do where its headings are in none of the letters of Western Europe."""
    what = f"it is not UTF-8; it was read as {layout.encoding} (Western Europe)"
    odd = next((name for name in layout.names if not name.isascii()), None)
    if odd is None:
        return Finding("encoding", what)
    what += f"; where {odd!r} should be another word, the file has another code page: save it as UTF-8 (Excel: CSV "
    what += "UTF-8), in a terminal as by `iconv -f SHIFT_JIS -t UTF-8 FILE > NEW`"
    known = all(word.isprintable() and "\ufffd" not in word for word in layout.names)
    return Finding("encoding", what, Gravity.NOTE if known else Gravity.WARNING)


def _table(path: Path, delimiter: str | None, decimal: str | None, progress: Progress | None) -> Table:
    layout = sniff(path, delimiter, decimal)
    findings: list[Finding] = []
    if layout.encoding != "utf-8":
        findings.append(_read_as(layout))
    end, cut = _end(path, layout)
    if cut is not None:
        findings.append(cut)
    names = unique(layout.names, findings)
    words, short = set(layout.words), False
    while True:  # a column that turns out to hold words is read again as such, once
        try:
            values, texts, remarks = _read(path, layout, words, end, progress, short)
            break
        except _NotNumber as error:
            if error.column in layout.dates and not short:
                short = True  # after midnight there may be days and hours without zeros
            else:
                words.add(error.column)
    found_late = {row for i, (row, _) in texts.items() if i not in layout.words}
    if not values and len(found_late) == 1:
        cells = ", ".join(repr(texts[i][1]) for i in sorted(texts) if i not in layout.words)
        what = f"data row {found_late.pop() + 1} holds words in every column ({cells:.80}): another table begins there"
        raise InputError(f"{what}; put each recording into a file of its own, or remove the line", str(path))
    if remarks:
        findings.append(Finding("comments", f"{remarks} remarks between the rows were passed over"))
    rows = max(map(len, values.values()), default=0)
    if len(names) >= _WIDE and _TIMES_WIDER * rows < len(names):
        raise in_rows(f"it has {rows} rows of {len(names)} cells", path)
    if layout.passed:
        what = f"a line above the first row of data has numbers, too, and was passed over: {layout.passed[:80]!r}"
        findings.append(Finding("headings", what, Gravity.WARNING))
    if layout.torn:
        what = f"the heading says {'; '.join(layout.torn[:8])}: the heading was followed; "
        findings.append(Finding("units", what + "give the unit in a map if the row below is right", Gravity.WARNING))
    if layout.scaled:
        what = f"{', '.join(layout.scaled[:8])}: a factor or an offset stands in the head of the file, which does not "
        what += "tell whether it is applied; compare the values with what was displayed, and give scale in a map if not"
        findings.append(Finding("units", what, Gravity.WARNING))
    if layout.announced is not None and layout.announced > rows:
        findings.append(missing_samples(layout.announced, rows, "the file announces"))
    if layout.surplus:
        what = f"no cells stand below {', '.join(map(repr, layout.surplus[:8]))} in the heading, which is wider than "
        gravity = Gravity.NOTE if layout.surplus == ("Comment",) else Gravity.WARNING  # LabVIEW's, which is often empty
        findings.append(Finding("headings", what + "the rows; the others were taken from the left", gravity))
    if layout.short:
        what = f"the line above the data has fewer cells ({layout.short[:60]!r}) than the rows, {len(names)}: nothing "
        what += "tells which names go with which columns; write one for each (in R by col.names = NA)"
        findings.append(Finding("headings", what, Gravity.WARNING))
    columns = {}
    for at, (name, unit) in enumerate(zip(names, layout.units, strict=True)):
        if at < layout.beside:
            continue
        unit = unit_of_name(name) if unit is None else unit
        if at in texts:
            columns[name] = Column(name, unit, np.full(rows, np.nan), text=texts[at])
        elif not (at and at == len(names) - 1 and name == f"column {at + 1}" and np.isnan(values[at]).all()):
            # but for what a delimiter at the end of each line makes
            columns[name] = Column(name, "s" if at in layout.dates else unit, values[at])
    if layout.counted is not None:
        begin, step = layout.counted
        number = columns["time"].values if "time" in columns else np.arange(rows)
        columns = {"time": Column("time", "s", begin + step * number)} | {
            name: column for name, column in columns.items() if name != "time"
        }
    if layout.times:
        columns = _with_own_times(_from_filetime(columns, layout.times), layout.times)
    return Table(path, "csv", columns, findings=tuple(findings))


def _from_filetime(columns: Mapping[str, Column], at: Sequence[int]) -> dict[str, Column]:
    """The columns with times in ms, where TwinCAT's scope wrote full stamps: Windows' FILETIME, in steps of 100 ns."""
    listed = [*columns.values()]
    stamps = [listed[i] for i in at if listed[i].unit == "ms"]
    known = [column.values[np.isfinite(column.values)] for column in stamps]
    begins = [float(values[0]) for values in known if len(values)]
    if len(stamps) < len(at) or not begins or not min(begins) > _FILETIME:
        return dict(columns)
    since = {id(column): replace(column, values=(column.values - min(begins)) * 1e-4) for column in stamps}
    return {name: since.get(id(column), column) for name, column in columns.items()}


def _with_own_times(columns: Mapping[str, Column], at: Sequence[int]) -> dict[str, Column]:
    """Channels with the times before them; one column of time where all have the same, as they are where no unit is."""
    listed = [*columns.values()]
    times = {i: listed[i] for i in at}
    if any(
        c.unit is None or c.text is not None or not (np.diff(c.values[np.isfinite(c.values)]) >= 0.0).all()
        for c in times.values()
    ):
        return dict(columns)  # not known, or no times
    channels = [column for i, column in enumerate(listed) if i not in times]
    first = listed[at[0]]
    if all(np.array_equal(column.values, first.values, equal_nan=True) for column in times.values()):
        return {"time": Column("time", first.unit, first.values)} | {c.name: c for c in channels}
    found = {}
    for i, column in enumerate(listed):
        if i in times:
            there = np.isfinite(column.values)  # a slower channel has fewer rows
            own = column.values[there] * factor(str(column.unit), "s")
        else:
            found[column.name] = replace(column, values=column.values[there], time=own)
    return found


def missing_samples(announced: int, found: int, who: str) -> Finding:
    """That a file has fewer samples than somebody says."""
    share = 100.0 * (1.0 - found / announced)
    what = f"{who} {announced} samples, and there are {found}: {share:.0f} % are missing; take a whole copy"
    return Finding("cut", what, Gravity.FAULT)


class _NotNumber(Exception):
    """A column that began with numbers goes on with words."""

    def __init__(self, column: int):
        self.column = column


def _read(
    path: Path, layout: Layout, words: set[int], end: int, progress: Progress | None, short: bool
) -> tuple[dict[int, np.ndarray], dict[int, tuple[int, str]], int]:
    """Numbers by column; of columns of words the first word with its row; how many remarks were passed over."""
    with needed_for("a log in a text file", where=str(path)):
        import pyarrow as pa
        from pyarrow import csv as arrow_csv

    keys = [str(i) for i in range(len(layout.names))]
    types = {key: pa.string() if int(key) in words else pa.float64() for key in keys}
    dates = {i: zone for i, zone in layout.dates.items() if i not in words}
    types |= {str(i): pa.timestamp("ns", tz="UTC" if zone else None) for i, zone in dates.items()}
    types |= {str(i): pa.time64("ns") for i in layout.clocks if i in dates}

    refused: list[Any] = []

    def refuse(row: Any) -> str:
        refused.append(row)  # Arrow passes on no error that is raised here
        return "error"

    stream = _Rows(path, layout, end, short)
    values: dict[int, list[np.ndarray]] = {i: [] for i in range(len(keys)) if i not in words}
    texts: dict[int, tuple[int, str]] = {}
    rows = 0
    try:
        reader = arrow_csv.open_csv(
            pa.PythonFile(stream, mode="r"),
            read_options=arrow_csv.ReadOptions(
                column_names=keys,
                block_size=_BLOCK,
                # code page 1252 leaves five bytes undefined; only words differ, and words are shown and no more
                encoding="latin-1" if layout.encoding == "cp1252" else layout.encoding,
            ),
            parse_options=arrow_csv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=refuse),
            convert_options=arrow_csv.ConvertOptions(
                column_types=types, decimal_point=layout.decimal, null_values=_NULLS
            ),
        )
        for batch in reader:
            for i in values:
                values[i].append(_numbers(batch.column(i)))
            for i in words - set(texts):
                found = _first_word(batch.column(i).to_pylist(), layout.decimal)
                if found is not None:
                    texts[i] = (rows + found[0], found[1])
            rows += batch.num_rows
            if progress is not None:
                progress(min(stream.done, end), end)
    except pa.ArrowInvalid as error:
        if refused:
            raise _line_fault(path, layout, refused[0].text, refused[0].actual_columns) from error
        found_column = re.search(r"CSV column #(\d+):(?: Row #\d+:)? CSV conversion error", str(error))
        if found_column is None or int(found_column[1]) in words:
            raise InputError(f"it cannot be read as a table: {error}", str(path)) from error
        raise _NotNumber(int(found_column[1])) from error
    finally:
        stream.close()
        if stream.problem is not None:
            raise stream.problem
    joined = {}
    for i in list(values):
        column = np.concatenate(values.pop(i) or [np.empty(0, dtype="datetime64[ns]" if i in dates else np.float64)])
        joined[i] = since_first(column) if i in dates else column
        if i in layout.american and np.ptp(joined[i][np.isfinite(joined[i])]) > 2.0 * _DAY:
            what = (
                f"{layout.names[i]!r} holds dates of several days, of which nobody knows whether the day or the month "
            )
            raise InputError(f"{what}is first; {DATE_REMEDY}", str(path))
        if i in layout.clocks:
            joined[i] = _through_midnight(joined[i])
    return joined, {i: texts.get(i, (0, "")) for i in words}, stream.remarks


class _Rows:
    """The rows of the file as Arrow wants them: no lines above the data, no remarks, one blank where there are many."""

    def __init__(self, path: Path, layout: Layout, end: int, short: bool):
        self._file, self._path = open(path, "rb"), path  # noqa: SIM115 (closed by close())
        self.problem: InputError | None = None  # Arrow passes on no error that is raised here
        self._end, self._short, self._spaces = end, short, layout.delimiter == " "
        self._delimiter, self._width = layout.delimiter.encode(), len(layout.names) if layout.ragged else 0
        for _ in range(layout.first):
            self._file.readline()  # within what the layout was found in
        self._rules: Sequence[Any] | None = None  # by which dates and exponents are turned, once the first are seen
        self.remarks, self.closed = 0, False

    @property
    def done(self) -> int:
        return self._file.tell()

    def read(self, size: int) -> bytes:
        """Whole lines, about `size` bytes of them; none at the end."""
        data = b""
        while not data:
            room = self._end - self._file.tell()
            if room <= 0:
                return b""
            data = self._file.read(min(size, room))
            data += self._rest_of_line()
            data, remarks = _REMARK.subn(b"", data)
            self.remarks += remarks
            if self._rules is None:
                self._rules = rules(data[:HEAD], self._delimiter.decode(), self._short)
            data = uniform(data, self._rules)
            if self._spaces:
                data = re.sub(rb"[ \t]+", b" ", _SPACES.sub(b"", data))
            if self._width:
                data = b"".join(map(self._filled, data.splitlines()))
        return data

    def _filled(self, line: bytes) -> bytes:
        """A row with all its cells: TwinCAT's scope leaves out those of the channels that have ended."""
        if not line.strip() or line.strip() == _END:
            return b""
        return line + self._delimiter * (self._width - 1 - line.count(self._delimiter)) + b"\n"

    def _rest_of_line(self) -> bytes:
        most = int(LINE * lifted())
        rest = self._file.readline(min(max(self._end - self._file.tell(), 0), most))
        if len(rest) == most and not rest.endswith(b"\n"):
            number = _lines_before(self._path, self._file.tell()) + 1
            where = f"{self._path}, line {number}"
            self.problem = refusal(f"it has a line of more than {most} bytes", LINE, "take another copy", where=where)
            raise self.problem
        return rest

    def close(self) -> None:
        self._file.close()
        self.closed = True

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return False


def _lines_before(path: Path, offset: int) -> int:
    """How many line breaks are before a byte of a file."""
    count = 0
    with open(path, "rb") as file:
        while offset > 0 and (data := file.read(min(offset, _BLOCK))):
            count, offset = count + data.count(b"\n"), offset - len(data)
    return count


def _numbers(cells: Any) -> np.ndarray:
    """A batch's cells as float64, NaN for blanks; dates as they are.

    From the buffers themselves: Arrow's own conversion imports pandas, where that is installed.
    """
    import pyarrow as pa

    dates = pa.types.is_timestamp(cells.type) or pa.types.is_time(cells.type)
    numbers = cells.view(pa.int64()) if dates else cells
    if numbers.null_count:
        numbers = numbers.fill_null(np.iinfo(np.int64).min if dates else np.nan)  # the first is NumPy's "no date"
    kind = np.int64 if dates else np.float64
    found = np.frombuffer(numbers.buffers()[1], kind, len(numbers), numbers.offset * np.dtype(kind).itemsize)
    return found.view("datetime64[ns]") if dates else found


def _through_midnight(seconds: np.ndarray) -> np.ndarray:
    """Times of day that go on where a day begins."""
    there = np.flatnonzero(np.isfinite(seconds))
    days = np.cumsum(np.diff(seconds[there], prepend=0.0) < -0.5 * _DAY)
    gone_on = seconds.copy()
    gone_on[there] += _DAY * days
    return gone_on


def _first_word(cells: Sequence[str | None], decimal: str) -> tuple[int, str] | None:
    return next(
        ((row, cell) for row, cell in enumerate(cells) if cell is not None and not is_number(cell.strip(), decimal)),
        None,
    )


def _line_fault(path: Path, layout: Layout, text: str, found: int) -> InputError:
    """The error that a line has too few or too many cells, with its number."""
    cells = split(text, layout.delimiter)
    where = str(path)
    with open(path, encoding=layout.encoding, errors="replace") as file:
        for number, line in enumerate(iter(lambda: file.readline(LINE), ""), 1):
            if number > layout.first and split(line.rstrip("\r\n"), layout.delimiter) == cells:
                where = f"{path}, line {number}"
                break
    return InputError(
        f"it has {found} cells ({text.strip()[:60]!r}) where the rows above have {len(layout.names)}; "
        "repair or remove the line",
        where,
    )


def _end(path: Path, layout: Layout) -> tuple[int, Finding | None]:
    """Where whole lines end, and what to say where the last one is cut."""
    size = path.stat().st_size
    with open(path, "rb") as file:
        file.seek(max(0, size - _TAIL))
        tail = file.read()
        if not tail.strip():  # a spreadsheet may have saved thousands of empty rows
            file.seek(max(0, size - _BLOCK))
            tail = file.read()
    rows = tail.rstrip()
    if rows and b"\n" in tail[len(rows) :]:
        return size - len(tail) + tail.index(b"\n", len(rows)) + 1, None  # lines of nothing but blanks may follow
    if tail.endswith((b"\n", b"\r")):
        return size, None
    *before, last = tail.rstrip(b" \t").split(b"\n")
    if layout.ragged and last.strip() == _END:
        return size, None
    if before and last.strip() == _DOS_END:
        return size - len(tail) + tail.rindex(b"\n") + 1, None
    others = [line for line in before[1:] if line.strip()]
    cells = len(split(last.decode(layout.encoding, "replace"), layout.delimiter))
    # rows that end with their channels tell nothing by their length; a \r is no character of a row
    if others and (layout.ragged or cells < len(layout.names) or len(last) < min(map(len, others)) - 1):
        what = f"it ends in the middle of a line ({last.decode(layout.encoding, 'replace')[:40]!r}): the file is cut. "
        return size - len(tail) + tail.rindex(b"\n") + 1, Finding(
            "cut", what + "The last line is left out; check that the rest is as long as the recording", Gravity.WARNING
        )
    return size, Finding("cut", "its last line has no end: if the file was cut there, its last number may be wrong")


def unique(names: Sequence[str], findings: list[Finding]) -> list[str]:
    """The headings; from its second time on, one that repeats has a number: `position`, `position (2)`."""
    found: list[str] = []
    for at, name in enumerate(names):
        number = 1 + names[:at].count(name)
        while (own := name if number == 1 else f"{name} ({number})") in found:
            number += 1
        found.append(own)
    if renamed := [own for own, name in zip(found, names, strict=True) if own != name]:
        what = f"columns have the same heading; the later ones are called {', '.join(map(repr, renamed[:8]))}"
        findings.append(Finding("headings", what, Gravity.WARNING))
    return found
