"""Traces as CODESYS, and the controllers made of it, save them as text: the samples of one variable after the other's.

    [key]; [value]
    IecTaskName; MainTask
    Flags; 16
    0.Variable; PLC_PRG.fActPos
    0.Data;
    ; 2; 0.125
    ; 22; 0.250
    1.Variable; PLC_PRG.fSetTorque
    ...

Each sample has its time stamp. The bit 16 of `Flags` says that stamps are in ms, the bit 32 that they are in µs.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import read_limited
from rds.identification.logs.csv_cells import BLANKS, decoded
from rds.identification.logs.log import Finding
from rds.identification.logs.table import Column, Table
from rds.identification.logs.units import factor, unit_of_name

_HEAD = re.compile(r"\[key\];\s*\[value\]")
_UNITS = {16: "ms", 32: "µs"}
_MOST = 1 << 28  # bytes
_KEY = re.compile(r"(?:(\d+)\.)?([\w.]*);\s*(.*)")
_WORDS = {"true": 1.0, "false": 0.0, **dict.fromkeys(BLANKS, np.nan)}


def is_trace(path: Path) -> bool:
    """Whether a text file is such a trace."""
    with open(path, "rb") as stream:
        return _HEAD.match(decoded(stream.read(64))) is not None


def read_trace(path: Path) -> Table:
    """The variables as columns, with one column `time` where all have the same stamps, else with times of their own.

    TRUE and FALSE are 1 and 0. InputError, with the line, for what is no trace, and for one whose variables were
    sampled at different times in a unit that the file does not give.
    """
    remedy = "save a shorter trace, or the recorded variables alone"
    lines = decoded(read_limited(path, _MOST, "a trace", remedy)).splitlines()
    flags, stamps = 0, []
    values: list[float] = []
    found: dict[str, tuple[list[float], list[float]]] = {}  # stamps and values by variable
    texts: dict[str, tuple[int, str]] = {}
    for number, line in enumerate(lines[1:], 2):
        where = f"{path}, line {number}"
        line = line.strip()
        if line.startswith(";"):
            if not found:
                raise InputError("this sample stands before any variable; save the trace again", where)
            stamp, _, cell = line[1:].partition(";")
            try:
                stamps.append(float(int(stamp)))
            except (ValueError, OverflowError):
                raise InputError(f"{stamp.strip()!r:.40} is no time stamp; save the trace again", where) from None
            value = _number(cell.strip())
            if value is None:
                texts.setdefault(next(reversed(found)), (len(values), cell.strip()))
            values.append(np.nan if value is None else value)
        elif line:
            key = _KEY.fullmatch(line)
            if key is None:
                raise InputError("it is neither `key; value` nor a sample `; time; value`; save the trace again", where)
            if key[1] is not None and key[2] == "Variable":
                if not key[3] or key[3] in found:
                    raise InputError(f"variable {key[3]!r} is recorded twice, or has no name; record it once", where)
                stamps, values = found[key[3]] = ([], [])
            elif key[2] == "Flags":
                flags = int(key[3]) if key[3].isdecimal() else 0
    empty = [name for name, (stamps, _) in found.items() if not stamps]
    if len(empty) == len(found):
        raise InputError("nothing was recorded in it; save the trace after it has run", str(path))
    columns = {
        name: Column(name, unit_of_name(name), np.array(values), np.array(stamps), texts.get(name))
        for name, (stamps, values) in found.items()
        if stamps
    }
    findings = [Finding("columns", f"left out, as nothing was recorded of them: {', '.join(empty)}")] if empty else []
    return Table(path, "codesys", _timed(columns, flags, path), findings=tuple(findings))


def _timed(columns: dict[str, Column], flags: int, path: Path) -> dict[str, Column]:
    """The columns with a time that is in a unit, as far as the file gives one."""
    units = [unit for bit, unit in _UNITS.items() if flags & bit]
    unit = units[0] if len(units) == 1 else None
    stamps = [column.time for column in columns.values() if column.time is not None]
    if all(np.array_equal(each, stamps[0]) for each in stamps):
        same = {name: replace(column, time=None) for name, column in columns.items()}
        name = "time" if "time" not in same else "time stamp"
        return {name: Column(name, unit, stamps[0])} | same
    if unit is None:
        raise InputError(
            "its variables were sampled at different times, and `Flags` does not say whether these are in ms (16) or "
            "µs (32); record all variables in one task",
            str(path),
        )
    for name, column in columns.items():
        if column.time is not None and (np.diff(column.time) <= 0.0).any():
            raise InputError(f"time stamps of variable {name!r} are repeated, or go back; record it again", str(path))
    second = factor(unit, "s")
    return {n: replace(c, time=c.time * second) for n, c in columns.items() if c.time is not None}


def _number(cell: str) -> float | None:
    if (word := cell.lower()) in _WORDS:
        return _WORDS[word]
    try:
        return float(cell)
    except ValueError:
        return None
