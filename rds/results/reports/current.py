"""Motor and spindle current: starting peak, running current, idle against work; energy where voltage and time allow.

Source: section 9.7, figures 94 to 98 and tables Q39 to Q43 of the thesis on the open architecture control system
(docs/thesis-reports.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.reading import Column, columns_in, names_of, read_columns, without_readings_of
from rds.results.reports.settings import Setting
from rds.results.reports.statistics import summary
from rds.results.reports.windows import EXAMPLE, Window, parse_windows

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "starting": Setting("readings at the start that belong to the starting peak", "", 1, whole=True, at_least=0),
    "idle": Setting(
        "readings at the start before the tool works; compared with the rest", "", 0, whole=True, at_least=0
    ),
    "windows": Setting(f"parts of the record to report by themselves, as in {EXAMPLE!r}", text=True),
    "period": Setting("time from one reading to the next; else a column time_s", "s", more_than=0),
    "voltage": Setting("supply voltage; with it and the time, the electrical energy", "V", more_than=0),
}

_AMPERES = {"A": 1.0, "mA": 1e-3}
_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}


@dataclass(frozen=True)
class Current:
    """One record of current."""

    name: str
    source: str  # what its file is called
    where: str
    values: np.ndarray  # A
    time: np.ndarray | None = None  # s


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Statistics and pictures of all files. InputError for data or options that will not do."""
    names = names_of(files)
    records = [record for path, name in zip(files, names, strict=True) for record in _read(path, name, settings)]
    starting, idle = settings["starting"], settings["idle"]
    for record in records:
        _long_enough(record, max(starting, idle))
    windows = [(r, w) for r in records for w in parse_windows(settings["windows"], len(r.values), r.where)]
    tables = [_table(records, starting)]
    if idle:
        tables.append(_work(records, idle))
    if windows:
        tables.append(_parts(windows))
    if settings["voltage"] is not None:
        tables.append(_energy(records, settings["voltage"]))
    return Report(
        "current",
        "Current",
        [path.name for path in files],
        settings,
        tables,
        {
            f"Current of {name}": partial(
                picture, [record for record in records if record.source == name], starting, idle
            )
            for name in names
        },
        _findings(records, starting, idle),
    )


def _read(path: Path, source: str, settings: Mapping[str, Any]) -> list[Current]:
    columns = without_readings_of(read_columns(path), "acceleration_[xyz]")  # for the report on vibration
    timed = next((column for column in columns if column.name.lower() in ("time", "t")), None)
    currents = columns_in(path, [c for c in columns if c is not timed], tuple(_AMPERES), "currents", "cw_A")
    time = _time(timed) if timed else None
    found = []
    for column in currents:
        values = _AMPERES[column.unit] * np.asarray(column.numbers(blanks=timed is None))
        at = time if settings["period"] is None else settings["period"] * _rows_read(column)
        name = source if len(currents) == 1 else f"{source} {column.name}"
        found.append(Current(name, source, str(path), values, at))
    return found


def _rows_read(column: Column) -> np.ndarray:
    """Which rows, from 0, have a reading in this column."""
    return np.flatnonzero([bool(cell) for cell in column.cells.values()])


def _time(column: Column) -> np.ndarray:
    if column.unit not in _SECONDS:
        raise InputError(f"column {column.heading!r} has no unit of time; head it time_s or time_ms", column.where)
    time = _SECONDS[column.unit] * np.asarray(column.numbers())
    back = np.flatnonzero(np.diff(time) <= 0)
    if len(back):
        line = list(column.cells)[int(back[0]) + 1]
        raise column.fault(line, f"time {column.cells[line]!r} is not after the one before; sort the readings")
    return time


def _long_enough(record: Current, left_out: int) -> None:
    if len(record.values) < left_out + 2:
        raise InputError(
            f"it has {len(record.values)} readings of {record.name!r}; with {left_out} at the start (options starting "
            f"and idle) it needs at least {left_out + 2}",
            record.where,
        )


def _table(records: Sequence[Current], starting: int) -> Table:
    columns = ["current", "readings", "starting peak [A]", "running mean [A]", "running std [A]", "running min [A]"]
    columns += ["running max [A]", "peak / running mean", "mean of all [A]"]
    rows = []
    for record in records:
        running = summary(record.values[starting:])
        peak = float(record.values[:starting].max()) if starting else None
        ratio = peak / running.mean if peak is not None and running.mean else None
        numbers = [peak, running.mean, running.std, running.low, running.high, ratio]
        rows.append([record.name, len(record.values), *numbers, float(record.values.mean())])
    note = f"Running: without the {starting} starting reading{'' if starting == 1 else 's'}."
    digits = {name: 3 for name in columns if "[A]" in name} | {"peak / running mean": 2}
    return Table("Starting and running", columns, rows, note, digits)


def _work(records: Sequence[Current], idle: int) -> Table:
    columns = ["current", "idle mean [A]", "work mean [A]", "work std [A]", "work max [A]", "work − idle [A]"]
    rows = []
    for record in records:
        before, work = summary(record.values[:idle]), summary(record.values[idle:])
        rows.append([record.name, before.mean, work.mean, work.std, work.high, work.mean - before.mean])
    note = f"Idle: the first {idle} readings; work: the others."
    return Table("Idle and at work", columns, rows, note, dict.fromkeys(columns[1:], 3))


def _parts(windows: Sequence[tuple[Current, Window]]) -> Table:
    columns = ["current", "part", "readings", "mean [A]", "std [A]", "min [A]", "max [A]"]
    rows = []
    for record, window in windows:
        s = summary(record.values[window.part])
        rows.append([record.name, window.name, f"{window.first} to {window.last}", s.mean, s.std, s.low, s.high])
    return Table("Parts", columns, rows, digits=dict.fromkeys(columns[3:], 3))


def _energy(records: Sequence[Current], voltage: float) -> Table:
    """Energy from the supply: voltage times the integral of the current (trapezoidal rule)."""
    rows = []
    for record in records:
        if record.time is None:
            raise InputError(
                "energy needs the time of the readings; give the option period in s, or a column time_s", record.where
            )
        steps = np.diff(record.time)
        charge = float(np.sum(steps * (record.values[1:] + record.values[:-1]) / 2))
        length = float(record.time[-1] - record.time[0])
        rows.append([record.name, length, charge, voltage * charge, voltage * charge / length])
    columns = ["current", "length [s]", "charge [A·s]", "energy [J]", "mean power [W]"]
    return Table("Energy", columns, rows, f"At {voltage:g} V.")


def _findings(records: Sequence[Current], starting: int, idle: int) -> list[str]:
    said = []
    for record in records:
        running = summary(record.values[starting:])
        start = f"starts with {record.values[:starting].max():.2f} A, " if starting else ""
        said.append(f"{record.name}: {start}runs at {running.mean:.3f} A (std {running.std:.3f} A).")
        if idle:
            before, work = summary(record.values[:idle]), summary(record.values[idle:])
            at = idle + int(np.argmax(record.values[idle:])) + 1
            said.append(
                f"{record.name}: idle {before.mean:.3f} A, at work {work.mean:.3f} A on average and at most "
                f"{work.high:.2f} A, at reading {at}."
            )
    return said


def picture(records: Sequence[Current], starting: int, idle: int) -> Picture:
    """Current of each reading and the mean of the running ones; starting readings ringed, idle ones shaded."""
    from rds.core.figure import CYCLE, GREY, Picture, dress, legend

    drawn = Picture(3.4)
    axes = drawn.subplots()
    timed = all(record.time is not None for record in records)
    for at, record in enumerate(records):
        x = record.time if timed and record.time is not None else np.arange(1, len(record.values) + 1)
        colour, line = CYCLE[at % len(CYCLE)], ("-", (0, (6, 1.5)), (0, (1, 1.2)))[at % 3]
        label = record.name.removeprefix(record.source).strip() or "current"
        axes.plot(x, record.values, "o", markersize=3.5, linestyle=line, linewidth=1.3, color=colour, label=label)
        axes.plot(x[:starting], record.values[:starting], "o", markersize=10, markerfacecolor="none", color=colour)
        mean = summary(record.values[starting:]).mean
        axes.axhline(mean, color=colour, linewidth=2.6, alpha=0.35, label=f"running mean {mean:.3f} A")
        if idle and at == 0:
            axes.axvspan(x[0], x[idle - 1], color=GREY, alpha=0.18, linewidth=0, label="idle")
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    dress(axes, "current [A]", "time [s]" if timed else "reading [number]")
    legend(axes, columns=5)
    return drawn
