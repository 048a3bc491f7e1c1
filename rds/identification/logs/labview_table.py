"""LabVIEW measurement files (.lvm), as `Write To Measurement File` saves them: text with a head for each recording.

    LabVIEW Measurement
    Separator       Tab                      or Comma
    X_Columns       No                       or One, or Multi: a column X_Value before each channel
    ***End_of_Header***

    Channels        2
    Samples         10          10
    Time            09:51:40,7  09:51:40,7
    Y_Unit_Label    V           mm
    X_Dimension     Time        Time
    X0              0,000000    0,000000     the time of the first sample
    Delta_X         0,001000    0,001000     and the step, where there is no column of times
    ***End_of_Header***
    X_Value         Command     Position     Comment
                    0,914018    1,204792

The head of a column stands in the column's own place. A file that was gone on with has several such recordings.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.identification.logs.csv_cells import BLANKS, decoded, is_number
from rds.identification.logs.csv_headings import name_and_unit
from rds.identification.logs.csv_table import missing_samples, unique
from rds.identification.logs.log import Finding, Gravity
from rds.identification.logs.table import Column, Table
from rds.identification.logs.units import dimension, plain

_MARK, _END, _X, _COMMENT = "LabVIEW Measurement", "***End_of_Header***", "X_Value", "Comment"
_HEADS = (_MARK, "Channels", "Notes", "Test_Name", "Test_Numbers", "Test_Series")  # a head's first line, among rows
_MOST = 1 << 28  # bytes
_ROUNDED = 1e-5  # relative error of a step by the digits that it is written with, from which it is worth saying
_DAY = 86400.0  # s


class _Recording:
    """One head with its rows: `label -> cells`, the headings, and the numbers row by row (NaN where there is none)."""

    def __init__(self, head: Mapping[str, Sequence[str]], headings: Sequence[str], comma: bool, place: str):
        self.head, self.comma, self.place = head, comma, place
        self.comments = headings[-1:] == [_COMMENT]
        self.headings = list(headings[: len(headings) - self.comments])
        self.numbers, self.said = array("d"), 0  # rows one after another; comments that say something
        self.beyond = 0  # rows with numbers in place of a comment, or in front of one

    def add(self, cells: Sequence[str], place: str) -> None:
        width = len(self.headings)
        if len(cells) > width:
            if not self.comments and any(cells[width:]):
                raise InputError(f"it has {len(cells)} cells under {width} headings; repair or remove the line", place)
            surplus = [cell for cell in cells[width:] if cell]
            self.beyond += self.comma and bool(surplus) and all(is_number(cell, ".") for cell in surplus)
            self.said += any(cells[width:])
        self.numbers.extend(_number(cell, place) for cell in cells[:width])
        self.numbers.extend([np.nan] * (width - len(cells)))

    def table(self) -> np.ndarray:
        return np.array(self.numbers).reshape(-1, len(self.headings))

    def at(self, label: str, column: int, default: str = "") -> str:
        """What the head says under `label` of a column."""
        cells = self.head.get(label, ())
        return cells[column] if column < len(cells) and cells[column] else default

    def unit(self, column: int) -> str | None:
        return self.at("Y_Unit_Label", column) or None


def is_labview(path: Path) -> bool:
    """Whether a text file is such a one."""
    with open(path, "rb") as stream:
        return decoded(stream.read(64)).startswith(_MARK)


def read_labview(path: Path) -> Table:
    """The channels as columns beside `time`, or with times of their own where these differ.

    Times are those of the columns X_Value, else they follow from X0 and Delta_X. Recordings one after another are
    joined by the times of day in their heads. InputError, with the line, for a row that is damaged.
    """
    findings: list[Finding] = []
    recordings = _recordings(path, findings)
    if not recordings:
        raise InputError("it has heads and no samples; record it again or take another copy", str(path))
    first = recordings[0]
    channels = [i for i, name in enumerate(first.headings) if i and name != _X]
    names = unique([first.headings[i] for i in channels], findings)
    times: dict[int, list[np.ndarray]] = {i: [] for i in channels}
    values: dict[int, list[np.ndarray]] = {i: [] for i in channels}
    for recording in recordings:
        if 2 * recording.beyond * len(recording.headings) > len(recording.numbers):
            what = "numbers stand beyond its channels, as where commas are decimal ones and divide cells, too"
            raise InputError(f"{what}; record it with Tab between cells", recording.place)
        if recording.headings != first.headings:
            what = f"this recording has other channels than the first one ({', '.join(recording.headings):.80})"
            raise InputError(f"{what}; put each into a file of its own, with the head of the file", recording.place)
        if changed := [i for i in channels if first.unit(i) != recording.unit(i)]:
            units = f"{first.unit(changed[0])} before, {recording.unit(changed[0])} here"
            what = f"the unit of {first.headings[changed[0]]} has changed ({units})"
            raise InputError(
                f"{what}; put each recording into a file of its own, with the head of the file", recording.place
            )
        since = _since(first, recording)
        for i in channels:
            x, y = _samples(recording, i)
            again = len(x) and any(len(each) and each[-1] >= x[0] for each in times[i])  # times begin anew
            times[i].append(x + (since if again else 0.0))
            values[i].append(y)
    columns, empty = {}, []
    for i, name in zip(channels, names, strict=True):
        own, unit = np.concatenate(values[i]), first.unit(i)
        bare, headed = name_and_unit(name)
        if headed is not None and (unit is None or plain(headed) == plain(unit)) and dimension(headed):
            name, unit = (bare if bare not in columns else name), headed
        if len(own):
            columns[name] = Column(name, unit, own, np.concatenate(times[i]))
        else:
            empty.append(name)
    if not columns:
        raise InputError("no channel has a sample; record it again or take another copy", str(path))
    if empty:
        findings.append(Finding("columns", f"left out, as nothing was recorded of them: {', '.join(empty)}"))
    if said := sum(recording.said for recording in recordings):
        findings.append(Finding("comments", f"comments beside {said} rows were passed over"))
    if len(recordings) > 1:
        what = f"{len(recordings)} recordings stand in it one after another; their times of day join them"
        findings.append(Finding("clock", what))
    announced = sum(
        max((int(cell) for cell in each.head.get("Samples", ()) if cell.isdecimal()), default=0) for each in recordings
    )
    rows = max(len(column.values) for column in columns.values())
    if announced > rows:  # a head may announce the first of many parts
        told = "its head announces" if len(recordings) == 1 else "its heads announce"
        findings.append(missing_samples(announced, rows, told))
    if np.isnan(first.table()[:, 0]).all():
        findings += _of_step(first.at("Delta_X", channels[0]).replace(",", "."))
    dimensions = {first.at("X_Dimension", i, "Time") for i in channels}
    return Table(path, "labview", _timed(columns, dimensions, path), findings=tuple(findings))


def _recordings(path: Path, findings: list[Finding]) -> list[_Recording]:
    """The recordings that have rows. A last line without its end is left out, which the findings tell."""
    remedy = "record a shorter stretch, or the channels of the axis alone"
    lines = decoded(read_limited(path, _MOST, "a measurement of LabVIEW", remedy)).splitlines(keepends=True)
    if lines[-1].strip() and lines[-1].splitlines() == [lines[-1]]:
        what = f"its last line has no end, as where a file was cut ({lines.pop().strip()!r:.40}): it is left out"
        findings.append(Finding("cut", what, Gravity.WARNING))
    comma = any(line.startswith("Separator,") for line in lines[:20])
    found: list[_Recording] = []
    head: dict[str, Sequence[str]] | None = {_MARK: ()}  # None below a heading, among rows
    awaited = False  # the row of headings is the next
    for number, line in enumerate(lines[1:], 2):
        cells = [cell.strip() for cell in line.split("," if comma else "\t")]
        if line.startswith(_END):
            head = head or {}
            awaited = "Channels" in head
            if not awaited and head.pop(_MARK, None) is None:
                raise InputError(
                    "the head above it has no line of Channels; take another copy", f"{path}, line {number}"
                )
        elif not any(cells):
            continue
        elif awaited:
            while not cells[-1]:
                cells.pop()
            found.append(_Recording(dict(head or {}), cells, comma, f"{path}, line {number}"))
            head, awaited = None, False
        elif head is not None:
            head[cells[0]] = cells
        elif cells[0] in _HEADS:
            head = {cells[0]: cells}
        else:
            found[-1].add(cells, f"{path}, line {number}")
    return [recording for recording in found if recording.numbers]


def _samples(recording: _Recording, channel: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a channel, up to its last value; a blank within stays one."""
    table = recording.table()
    x, y = table[:, channel - 1 if recording.headings.count(_X) > 1 else 0], table[:, channel]
    if np.isnan(x).all():
        begin, step = (_number(recording.at(label, channel), recording.place) for label in ("X0", "Delta_X"))
        if not isfinite(step):
            raise InputError("its head gives no Delta_X, and no column has times; record it again", recording.place)
        x = np.nan_to_num(begin) + step * np.arange(len(table))
    there = np.isfinite(x) & (np.isfinite(y)[::-1].cumsum()[::-1] > 0)
    return x[there], y[there]


def _since(first: _Recording, recording: _Recording) -> float:
    """How many s after the first one a recording began, by date and time of day in their heads; 0 if these are none."""
    spans = []
    for each in (first, recording):
        day, time = ([cell for cell in each.head.get(label, ())[1:] if cell] for label in ("Date", "Time"))
        try:
            hours, minutes, seconds = time[0].replace(",", ".").split(":")
            days = np.datetime64(day[0].replace("/", "-"), "D").astype(int)
            spans.append(_DAY * days + 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds))
        except (IndexError, ValueError):
            return 0.0
    return float(spans[1] - spans[0])


def _of_step(step: str) -> list[Finding]:
    """That a step such as 0.000977 (1/1024) is written with so few digits that times drift away from the true ones."""
    if "e" in step.lower() or "." not in step:
        return []
    value = float(step)
    error = 0.5 * 10.0 ** -len(step.partition(".")[2]) / value if value else 0.0
    rate = 1.0 / value if value else 0.0
    if error < _ROUNDED or abs(rate - round(rate)) < 1e-6 * rate or len(step.replace(".", "").strip("0")) <= 2:
        return []
    what = f"its time follows from Delta_X = {step} s, which is rounded: times, and speeds and time constants by them, "
    what += f"may be {100.0 * error:.2g} % off; where the rate is known (perhaps {2 ** round(np.log2(rate))} Hz), "
    return [Finding("clock", what + "say rate = ... under [time] in a map", Gravity.WARNING)]


def _timed(columns: dict[str, Column], dimensions: set[str], path: Path) -> dict[str, Column]:
    """One column of times, where all channels have the same; else times of their own, which must not go back."""
    stamps = [column.time for column in columns.values() if column.time is not None]
    unit = "s" if dimensions == {"Time"} else None
    if all(np.array_equal(each, stamps[0]) for each in stamps):
        same = {name: replace(column, time=None) for name, column in columns.items()}
        name = "time" if unit else _X
        return {name: Column(name, unit, stamps[0])} | same
    if unit is None:
        what = f"its channels are over {', '.join(sorted(dimensions))}"
        raise InputError(f"{what}, and have values of their own; record them over time", str(path))
    for name, column in columns.items():
        if column.time is not None and (np.diff(column.time) <= 0.0).any():
            raise InputError(f"times of channel {name!r} are repeated, or go back; record it again", str(path))
    return columns


def _number(cell: str, place: str) -> float:
    try:
        value = np.nan if cell.lower() in BLANKS else float(cell.replace(",", "."))
        if "_" in cell:  # which Python reads as in 1_000
            raise ValueError
    except ValueError:
        raise InputError(f"{cell!r:.40} is no number; repair or remove the line", place) from None
    return value if isfinite(value) else np.nan
