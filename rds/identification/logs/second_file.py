"""A second recorder's file, with its clock made that of the first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rds.core.errors import InputError
from rds.identification.logs.clocks import Alignment, align
from rds.identification.logs.columns import column_time
from rds.identification.logs.log import Finding, Gravity
from rds.identification.logs.map import LogMap
from rds.identification.logs.table import Table
from rds.identification.logs.tables import read_table

_POOR = 0.1  # of a sample period: an uncertainty of the offset beyond it is a warning


@dataclass(frozen=True)
class SecondFile:
    """The second file's columns, its times on the first clock (s), and how well they are known."""

    table: Table
    time: np.ndarray
    alignment: Alignment
    findings: tuple[Finding, ...]


def read_second(first: Table, mapping: LogMap) -> SecondFile:
    """Read and align the file of `[second]`. InputError, at the map, where it cannot be done."""
    about = mapping.second
    assert about is not None
    table = read_table(about.file, about.delimiter, about.decimal, mapping.dbc)
    time = column_time(table, about.time)
    if about.offset is not None:
        stamps = [time, *(column.time for column in table.columns.values() if column.time is not None)]
        begin = float(np.nanmin(np.concatenate(stamps)))
        alignment = Alignment(about.offset, about.drift or 0.0, 0.0, 0.0, begin, np.nan)
        what = (
            f"second clock: offset {about.offset:g} s and drift {1e6 * (about.drift or 0.0):g} ppm, as the map states"
        )
        return SecondFile(table, alignment.to_first(time), alignment, (Finding("clock", what),))
    assert about.first_column is not None and about.second_column is not None
    own = first.column(about.first_column, about.place)
    other = table.column(about.second_column, about.place)
    own_time = own.time if own.time is not None else column_time(first, mapping.time)
    other_time = other.time if other.time is not None else time
    (own_time, own_values), (other_time, other_values) = _clean(own_time, own.values), _clean(other_time, other.values)
    try:
        alignment = align(own_time, own_values, other_time, other_values, about.relation, about.window)
    except InputError as error:
        raise InputError(str(error), about.place) from error
    period = float(np.median(np.diff(own_time)))
    worst = max(alignment.uncertainty(float(at)) for at in (other_time[0], other_time[-1]))
    what = (
        f"second clock: first = second {alignment.offset:+.6g} s (± {alignment.offset_error:.2g}), drift "
        f"{1e6 * alignment.drift:+.4g} ppm (± {1e6 * alignment.drift_error:.2g}), one standard error each, from "
        f"{about.first_column!r} and {about.second_column!r}, which correlate by {alignment.correlation:.4f}; its "
        f"times are known to {worst:.2g} s"
    )
    poor = worst > _POOR * period
    if poor:
        what += f", more than {100 * _POOR:g} % of the sample period: a delay or a short time constant cannot be told"
    if about.relation == "rate":
        what += ". The lag of the axis behind its command is part of the offset"
    findings = (Finding("clock", what, Gravity.WARNING if poor or about.relation == "rate" else Gravity.NOTE),)
    return SecondFile(table, alignment.to_first(time), alignment, findings)


def _clean(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers at times that increase: blanks and repeated times are left out of the alignment."""
    good = np.isfinite(time) & np.isfinite(values)
    time, values = time[good], values[good]
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(time)) > 0.0]) if len(time) else good[:0]
    return time[rising], values[rising]
