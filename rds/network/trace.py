"""Recorded delays as a CSV file: a row for each sample, a column for each part of the delay, in s.

    sensor,computing,actuator
    0.000213,0.000041,0.000187
    ,0.000040,0.000190

An empty cell, or `nan`, is a message that was lost. Lines that begin with # are comments.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from math import isnan
from pathlib import Path

import numpy as np

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.limits import TABLE, read_limited
from rds.network.distributions import MOST

COLUMNS = ("sensor", "computing", "actuator")


def read_trace(path: str | Path) -> dict[str, np.ndarray]:
    """The columns of a trace, s, with NaN for a lost message; InputError with file and line for what will not do."""
    try:
        text = read_limited(Path(path), TABLE, "a trace of delays", "give a part of it").decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; check the file's name", str(path)) from error
    except UnicodeDecodeError as error:
        raise InputError("it is not UTF-8 text; save it as CSV", str(path)) from error
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if not line.lstrip().startswith("#")]
    while lines and not lines[0][1].strip():
        lines.pop(0)
    if not lines:
        raise InputError(f"it is empty; its first line names the columns, of {', '.join(COLUMNS)}", str(path))
    names = [name.strip() for name in next(csv.reader([lines[0][1]]))]
    if unknown := [name for name in names if name not in COLUMNS]:
        has = f"column {unknown[0]!r} is unknown; the columns of a trace are {', '.join(COLUMNS)}"
        raise InputError(has, f"{path}:{lines[0][0]}")
    if len(set(names)) < len(names):
        raise InputError("it names a column twice", f"{path}:{lines[0][0]}")
    rows = [_row(line, names, f"{path}:{number}") for number, line in lines[1:] if line.strip() or len(names) == 1]
    if not rows:
        raise InputError("it has no rows of delays below its heading; measure again, for longer", str(path))
    return dict(zip(names, np.array(rows).T, strict=True))


def _row(line: str, names: list[str], place: str) -> list[float]:
    cells = next(csv.reader([line])) or [""]
    if len(cells) != len(names):
        raise InputError(f"this row has {len(cells)} cells; the heading names {len(names)} columns", place)
    return [_cell(cell.strip(), name, place) for cell, name in zip(cells, names, strict=True)]


def _cell(cell: str, name: str, place: str) -> float:
    try:
        value = float(cell) if cell else float("nan")
    except ValueError:
        raise InputError(f"{name} = {cell!r:.50} must be a delay in s, or empty for a lost message", place) from None
    if not (isnan(value) or 0.0 <= value <= MOST):
        raise InputError(f"{name} = {cell} must be a delay from 0 to {MOST:g} s, or empty for a lost message", place)
    return value


def write_trace(path: str | Path, columns: Mapping[str, np.ndarray], comments: tuple[str, ...] = ()) -> None:
    """Write delays (s; NaN: lost) as a trace that `read_trace` and a [network] table read."""
    lines = [f"# {comment}" for comment in comments] + [",".join(columns)]
    rows = zip(*(columns[name] for name in columns), strict=True)
    lines += [",".join("" if isnan(value) else f"{value:.9g}" for value in row) for row in rows]
    write_whole(Path(path), ("\n".join(lines) + "\n").encode())


def read_total(path: str | Path, part: str = "total") -> np.ndarray:
    """One delay of a trace, s: that of `part`, or the sum of all its columns; NaN where a message was lost."""
    columns = read_trace(path)
    if part == "total":
        total: np.ndarray = sum(columns.values(), np.zeros(len(next(iter(columns.values())))))
        return total
    if part not in columns:
        raise InputError(f"it has no delay {part!r}; it has total, {', '.join(columns)}", str(path))
    return columns[part]
