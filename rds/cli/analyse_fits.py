"""`rds bus analyse` where it says what fits: methods on a serial line or CAN by its rate, experiments on CAN."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from rds.cli.common import print_json, save_picture
from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.bus.analysis.analysis_report import Analysis
    from rds.bus.analysis.measured import Measured
    from rds.machines import Machine

_BITRATES = (125_000, 250_000, 500_000, 1_000_000)
_CAN_COLUMNS = ("bit rate [bit/s]", "load at worst [%]", "last answer at worst [ms]", "margin [%]", "fits")


def show_serial(
    machine: Machine, baud: int | None, units: int | None, period: float | None, plot: Path | None, json: bool
) -> bool:
    """The table of methods on a serial line; whether method A with answers fits at `baud` (default 115200)."""
    from rds.bus.analysis import serial_line
    from rds.bus.hub.bus_settings import BAUD, DEFAULT_BAUD

    rate = DEFAULT_BAUD if baud is None else BAUD.check(baud, "baud")
    count = len(machine.axes) if units is None else units
    T = machine.sample_period if period is None else period
    bauds = sorted({*serial_line.BAUDS, rate}) if baud is None else [rate]
    rows = serial_line.table(count, T, bauds)
    if plot is not None:
        save_picture(serial_line.plot(machine, T), plot)
    asked = serial_line.fits(count, rate, T)[1]
    rest = serial_line.filling_time(count, rate)
    found = {
        "machine": machine.name,
        "units": count,
        "period_s": T,
        "columns": list(serial_line.COLUMNS),
        "rows": rows,
        "baud": rate,
        "fits": asked.fits,
        "filling_s": rest,
    }
    if json:
        print_json(found)
        return asked.fits
    from rds.cli.console import cell, show_table

    title = f"{machine.name}: {count} units, a period of {T * 1e3:g} ms"
    show_table(title, serial_line.COLUMNS, [[cell(value) for value in row] for row in rows])
    verdict = f"it does not fit; it misses {-asked.left * 1e3:.2f} ms"
    if asked.left >= 0.0:
        verdict = f"it fits, and leaves {asked.left * 1e3:.2f} ms"
        if not asked.fits:
            verdict = f"a loop, which may take {asked.share:.0%} of the period, does not fit"
    typer.echo(
        f"At {rate} bit/s a cycle with answers takes {asked.time * 1e3:.2f} ms: {verdict}. "
        f"Filling the buffers of the thesis stops the motion for {rest:.2f} s."
    )
    if plot is not None:
        typer.echo(f"plot: {plot}")
    return asked.fits


def can_rows(machine: Machine, period: float | None, **words: Any) -> list[list[Any]]:
    """What fits on a CAN bus, by bit rate: load, the last answer at worst, and the margin to the period."""
    from rds.bus.analysis.analysis_report import analyse

    T = machine.sample_period if period is None else period
    rows: list[list[Any]] = []
    for bitrate in _BITRATES:
        found = analyse(machine, bitrate, period, **words)
        bounded = isfinite(found.worst_cycle)
        last = found.worst_cycle * 1e3 if bounded else None
        margin = 100.0 * (1.0 - found.worst_cycle / T) if bounded else None
        rows.append([bitrate, found.worst_load_percent, last, margin, "yes" if found.met else "no"])
    return rows


def can_methods(machine: Machine, period: float | None, bitrate: int | None, units: int | None) -> list[list[Any]]:
    """What methods A, B and C of the modules of dialect rds take of a CAN bus, by bit rate, or at one."""
    from rds.bus.analysis import can_curves

    T = machine.sample_period if period is None else period
    count = sum(not axis.is_spindle for axis in machine.axes.values()) if units is None else units
    return can_curves.table(count, T, _BITRATES if bitrate is None else [bitrate])


def show_can(rows: list[list[Any]], methods: list[list[Any]]) -> None:
    """The tables of `can_rows` and, of dialect rds, `can_methods`."""
    from rds.bus.analysis.can_curves import COLUMNS
    from rds.cli.console import cell, show_table

    show_table("What fits", _CAN_COLUMNS, [[cell(value) for value in row] for row in rows])
    if methods:
        show_table("A part program by methods", COLUMNS, [[cell(value) for value in row] for row in methods])


def draw(plot: Path, analysis: Analysis, measured: Measured | None = None) -> None:
    """The timeline and response times of an analysis, and over them what was measured."""
    from rds.bus.analysis.analysis_plot import plot as draw_analysis

    save_picture(draw_analysis(analysis, measured), plot)


def draw_can(
    plot: Path,
    analysis: Analysis,
    machine: Machine,
    period: float | None,
    dialect: str,
    fits: bool,
    measured: Measured | None = None,
) -> None:
    """The timeline of an analysis; with `fits` the curves of methods A, B and C, which are of dialect rds."""
    if not fits:
        draw(plot, analysis, measured)
        return
    if dialect != "rds":
        raise InputError(f"--fits --plot draws the curves of dialect rds, not of {dialect}; leave --fits or --plot out")
    from rds.bus.analysis.can_curves import plot as draw_curves

    save_picture(draw_curves(machine, machine.sample_period if period is None else period), plot)
