"""What a microcontroller prints for a serial plotter, saved from a terminal: each number behind its label.

    =~=~=~=~=~=~= PuTTY log 2021.12.19 17:30:01 =~=~=~=~=~=~=
    setpoint:100,speed:98.3                                  Voltage: 25.91V, RPM: 0

Lines with other labels, as the first one where the terminal was late, are passed over, which is said.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import TABLE, read_limited
from rds.identification.logs.log import Finding, Gravity
from rds.identification.logs.table import Column, Table
from rds.identification.logs.units import unit_of_name
from rds.results.units import split_heading

# Each part has a length at most, so that no line takes long; of two words behind a number, the first is no unit.
_CELL = re.compile(
    r"[\s,;|]*(?P<label>[^\W\d][\w ()\[\]/%.-]{0,60}?)\s{0,4}[:=]\s{0,9}"
    r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
    r"(?: ?(?P<unit>[A-Za-z%°µ/]+)(?=[\t,;|]|$)|(?P<close>[A-Za-z%°µ/]*)(?=[\s,;|]|$))"
)
_HEAD = 1 << 14  # bytes looked at
_LEAST, _MOST = 4, 50  # lines looked at
_SHARE = 0.8  # of the lines: those that have the usual labels


def is_labelled(path: Path) -> bool:
    """Whether nearly all lines of a text are numbers behind the same labels."""
    with open(path, "rb") as stream:
        rows = [_cells(line) for line in _lines(stream.read(_HEAD))[1:-1][:_MOST]]
    usual = _usual(rows)
    return bool(usual) and len(rows) >= _LEAST and sum(_labels(row) == usual for row in rows) >= _SHARE * len(rows)


def read_labelled(path: Path) -> Table:
    """The labels as columns; units where they stand behind each number. InputError where labels change in between."""
    lines = _lines(read_limited(path, TABLE, "a log of labelled numbers", "save a part of it"))
    rows = [_cells(line) for line in lines]
    usual = _usual(rows)
    kept = [row for row in rows if _labels(row) == usual]
    others = [line for line, row in zip(lines, rows, strict=True) if _labels(row) != usual]
    if len(kept) < _SHARE * len(rows):
        what = f"{len(others)} of its {len(rows)} lines have other labels than {', '.join(usual[:4])}"
        remedy = "print one line for each sample, with the same labels"
        raise InputError(f"{what}, the first one is {others[0][:60]!r}; {remedy}", str(path))
    values = np.array([[float(number) for _, number, _ in row] for row in kept])
    columns = {}
    for at, label in enumerate(usual):
        units = {row[at][2] for row in kept}
        name, unit = split_heading(label)
        columns[name] = Column(name, unit or (units.pop() or None if len(units) == 1 else None), values[:, at].copy())
        if columns[name].unit is None:
            columns[name] = Column(name, unit_of_name(name), values[:, at].copy())
    if len(columns) < len(usual):
        raise InputError(f"two numbers of a line have the same label ({', '.join(usual[:8])}); rename one", str(path))
    findings = []
    if others:
        what = f"{len(others)} lines with other labels, or none, were passed over; the first one is {others[0][:60]!r}"
        findings.append(Finding("comments", what, Gravity.NOTE if len(others) <= 2 else Gravity.WARNING))
    return Table(path, "labelled", columns, findings=tuple(findings))


def _lines(data: bytes) -> list[str]:
    text = data.replace(b"\0", b"").decode("utf-8-sig", "replace")  # a terminal that is opened late writes zeros
    return [line.strip() for line in text.splitlines() if line.strip() and not line.startswith("=~=~")]


def _cells(line: str) -> list[tuple[str, str, str]]:
    """Label, number and unit of each cell; none where something else stands in the line."""
    found, at = [], 0
    while match := _CELL.match(line, at):
        found.append((match["label"].strip(), match["number"], match["unit"] or match["close"] or ""))
        at = match.end()
    return found if not line[at:].strip(" \t,;|") else []


def _labels(row: list[tuple[str, str, str]]) -> tuple[str, ...]:
    return tuple(label for label, _, _ in row)


def _usual(rows: list[list[tuple[str, str, str]]]) -> tuple[str, ...]:
    counted = Counter(_labels(row) for row in rows if row)
    return counted.most_common(1)[0][0] if counted else ()
