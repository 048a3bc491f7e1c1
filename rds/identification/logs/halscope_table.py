"""What LinuxCNC's halscope saves: pins in columns, sampled at a period that the first line gives.

# Sampling period is 1000000 ns            until LinuxCNC 2.8: Sampling period is 1000000 nSec
joint.0.motor-pos-cmd;pid.x.output
# Position: 0.000000;0.000000
# Scale: 5;5
1.50000000000000;0.25000000000000          joint.0.motor-pos-cmd +1.50000000000000 pid.x.output +0.25000000000000

Where the desktop has decimal commas, its numbers have them, too: +1,50000000000000.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.identification.logs.log import Finding
from rds.identification.logs.table import Column, Table
from rds.identification.logs.units import unit_of_name

_HEAD = re.compile(rb"(?:# )?Sampling period is (\d+) n(?:Sec|s)\s")
_MOST = 1 << 28  # bytes
_UNUSED = "(null)"  # a channel without a pin


def is_halscope(path: Path) -> bool:
    """Whether a text file is such a log."""
    with open(path, "rb") as stream:
        return _HEAD.match(stream.read(64)) is not None


def read_halscope(path: Path) -> Table:
    """The pins as columns beside `time` (s), which follows from the sampling period. InputError, with the line, for a
    row that is damaged.
    """
    data = read_limited(path, _MOST, "a log of halscope", "save fewer samples")
    head = _HEAD.match(data)
    assert head is not None
    lines = list(enumerate(data.decode("utf-8", "replace").splitlines(), 1))[1:]
    rows = [(number, line.split(";" if ";" in line else None)) for number, line in lines if _is_row(line)]
    names: list[str] = []
    if rows and not _is_number(rows[0][1][-1]):
        names = rows.pop(0)[1]  # a row of headings, since LinuxCNC 2.9
    elif rows:
        names = rows[0][1][::2]
        rows = [(number, cells[1::2] if cells[::2] == names else cells) for number, cells in rows]
    if not rows:
        raise InputError("no samples are in it; save the log after halscope has triggered", str(path))
    values = np.empty((len(rows), len(names)))
    for at, (number, cells) in enumerate(rows):
        try:
            values[at] = [_number(cell) for cell in cells]
        except ValueError:
            problem = f"it has not one number for each of the {len(names)} pins: the line is cut or damaged"
            raise InputError(f"{problem}; remove the line", f"{path}, line {number}") from None
    period = int(head[1]) * 1e-9
    columns = {"time": Column("time", "s", np.arange(len(rows)) * period)}
    for name, column in zip(names, values.T, strict=True):
        if name.strip() != _UNUSED:
            columns[name.strip()] = Column(name.strip(), unit_of_name(name.strip()), column.copy())
    said = f"the time follows from halscope's sampling period, {period:g} s"
    return Table(path, "halscope", columns, findings=(Finding("clock", said),))


def _is_row(line: str) -> bool:
    return bool(line.strip()) and not line.startswith("#")


def _number(cell: str) -> float:
    return float(cell.replace(",", "."))


def _is_number(cell: str) -> bool:
    try:
        _number(cell)
    except ValueError:
        return False
    return True
