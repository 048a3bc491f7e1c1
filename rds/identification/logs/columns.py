"""Columns as quantities: units converted explicitly, counts by the resolution, with what was found on the way."""

from __future__ import annotations

from math import isclose

import numpy as np

from rds.core.errors import InputError
from rds.identification.logs.log import Finding, Gravity
from rds.identification.logs.map import TimeMap
from rds.identification.logs.map_axis import DIMENSIONS, ColumnMap
from rds.identification.logs.steps import BEYOND_MEASURE
from rds.identification.logs.table import Column, Table
from rds.identification.logs.units import base, check_unit, dimension, factor, plain

_AMBIGUOUS = 0.4  # of a counter's range, in a sample: it may have gone the other way round
_YEAR = 3.156e7  # s
_NO_DATE = 1e11  # s: MATLAB counts days since the year 0, others since 1601, 1904, or 1970
_LATE = 1e7  # s: times beyond are dates, of which a float64 in s keeps 0.1 µs only: they are counted from the first


def column_time(table: Table, about: TimeMap) -> np.ndarray:
    """The time of each row in s. InputError where nothing tells it, or its unit."""
    if table.own_times and (about.rate is not None or about.column is not None):
        given = f"rate = {about.rate:g}" if about.rate is not None else f"column = {about.column!r}"
        own = "is a bus log, whose times are those of receipt" if table.format == "can" else "has times for each signal"
        raise InputError(f"{table.path.name} {own}; leave {given} out", about.place)
    if about.rate is not None:
        return np.arange(table.rows) / about.rate
    if about.column is None:
        if table.own_times:
            return np.empty(0)  # each signal has its own
        raise InputError(
            'nothing tells the time of the rows; give column = "..." and unit under [time], or rate (Hz) where they '
            "are equally spaced",
            about.place or str(table.path),
        )
    column = table.column(about.column, about.place)
    unit = _unit(column, about.unit, "time", about.place)
    second = factor(unit, "s")
    numbers = column.values if about.wrap is None else _unwrapped(column.values, about.wrap)[0]
    values = (about.scale * numbers + about.offset) * second
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) and abs(values[finite[0]]) > _NO_DATE:
        years = abs(values[finite[0]]) / _YEAR
        what = f"time ({column.name!r}) begins after {years:.0f} years, counted in {unit}"
        raise InputError(f"{what}: later than any date; give the column a smaller unit in the map", about.place)
    _check_size(values, f"time ({column.name!r}, in s)", about.place)
    if len(finite) and abs(values[finite[0]]) > _LATE:  # from the first row on, before digits are lost to its size
        values = about.scale * (numbers - numbers[finite[0]]) * second
    return values


def _is_same(unit: str, about: ColumnMap) -> bool:
    """Whether a file's unit is the map's, or the map's `scale` converts the one to the other."""
    named = about.unit or ""
    if plain(named) == plain(unit):
        return True
    return dimension(unit) == dimension(named) is not None and isclose(about.scale, factor(unit, named), rel_tol=1e-6)


def quantity(
    column: Column, about: ColumnMap, name: str, resolution: float | None, target: str | None
) -> tuple[np.ndarray, str, list[Finding]]:
    """A column's values in the base unit of what it measures, that unit, and findings.

    `resolution` is in `target` (mm, deg, rev/min) per count. InputError for an unknown unit, one that this quantity
    cannot have, or counts without a resolution.
    """
    unit = _unit(column, about.unit, name, about.place)
    of = check_unit(unit, DIMENSIONS[name], f"{name} ({column.name!r})")
    findings = []
    if about.unit is not None and column.unit is not None and not _is_same(column.unit, about):
        what = (
            f"the file says that {column.name!r} is in {column.unit}, the map says {about.unit}: the map was followed"
        )
        findings.append(Finding("units", what, Gravity.WARNING))
    values = column.values
    _check_size(values, f"{name} ({column.name!r})", about.place)
    if about.wrap is not None:
        values, most = _unwrapped(values, about.wrap)
        if most > _AMBIGUOUS * about.wrap:
            what = (
                f"{name} moves by up to {100.0 * most / about.wrap:.0f} % of its wrap-around ({about.wrap:g}) in a "
                "sample: which way it went is a guess; sample faster, or check wrap in the map"
            )
            findings.append(Finding("wrap", what, Gravity.FAULT))
    if about.scale != 1.0 or about.offset != 0.0 or about.sign != 1:
        values = about.sign * (about.scale * values + about.offset)
    if of in ("counts", "count speed"):
        if resolution is None:
            raise InputError(
                f"{name} ({column.name!r}) is in encoder counts; give resolution (mm per count) or counts_per_unit for "
                'the axis, or a machine that has it, as in machine = "mini-cnc"',
                about.place,
            )
        unit = (target or "mm") + ("/s" if of == "count speed" else "")
        return values * resolution, unit, findings
    unit_out = base(of)
    if of == "angular speed" and name == "velocity" and target == "deg":
        unit_out = "deg/s"
    times = factor(unit, unit_out)
    return (values if times == 1.0 else values * times), unit_out, findings


def _unwrapped(values: np.ndarray, period: float) -> tuple[np.ndarray, float]:
    """The numbers of a counter that begins again at `period`, going on instead; and the largest step then."""
    going_on = values.copy()
    known = np.flatnonzero(np.isfinite(values))
    going_on[known] = np.unwrap(values[known], period=period)
    return going_on, float(np.abs(np.diff(going_on[known])).max(initial=0.0))


def _check_size(values: np.ndarray, what: str, place: str) -> None:
    with np.errstate(invalid="ignore"):
        far = np.abs(values) > BEYOND_MEASURE
    far &= np.isfinite(values)  # what is not finite is a blank, and told as such
    if far.any():
        k = int(np.argmax(far))
        raise InputError(f"{what} holds {values[k]:g} in row {k}, beyond what is measured ({BEYOND_MEASURE:g})", place)


def _unit(column: Column, stated: str | None, name: str, place: str) -> str:
    unit = stated or column.unit
    if unit is None:
        raise InputError(f'nothing gives the unit of {column.name!r} ({name}); give it, as in unit = "mm"', place)
    if dimension(unit) is None or name == "time":
        check_unit(unit, DIMENSIONS[name], f"{name} ({column.name!r})")
    return unit
