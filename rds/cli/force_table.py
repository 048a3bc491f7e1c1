"""Measured cutting forces from a table, fitted, and the coefficients as a file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.toml_text import toml_text
from rds.machines.forces.fit import NAMES, ForceFit, fit_force
from rds.results.reports.reading import read_columns

UNITS = {"force": "N", "depth": "mm", "speed": "m/min", "feed": "mm"}


def fit_table(path: str | Path, fix: Mapping[str, float] | None = None) -> ForceFit:
    """The coefficients from the columns force and some of depth, speed, feed of a CSV file; `fix` are known exponents.

    Raises InputError, with file, line and column, for a table that has no force, another unit, or cells that are no
    numbers, and as `fit_force` does.
    """
    columns = {column.name.lower(): column for column in read_columns(Path(path))}
    if unknown := [name for name in columns if name not in UNITS]:
        raise InputError(f"column {unknown[0]!r} is none of a force table; those are {', '.join(UNITS)}", str(path))
    if "force" not in columns:
        raise InputError(f"it has no column 'force'; its columns are {', '.join(columns)}", str(path))
    for name, column in columns.items():
        if column.unit not in ("", UNITS[name]):
            raise InputError(f"column {name!r} is in {column.unit}; give it in {UNITS[name]}", str(path))
    numbers = {name: np.array(column.numbers()) for name, column in columns.items()}
    try:
        return fit_force(numbers.pop("force"), numbers, dict(fix or {}))
    except InputError as error:
        raise InputError(str(error), str(path)) from None


def fit_toml(found: ForceFit, name: str, material: str, tool: str, data: str) -> bytes:
    """A file of coefficients with the fitted ones under `name`."""
    told = [f"{key}: {low:.5g} to {high:.5g}" for key, (low, high) in found.intervals.items()]
    comment = f"Fitted to {found.readings} readings of {data}. Intervals of 95 %: {', '.join(told)}."
    values = {key: found.values[key] for key in ("K", *NAMES)}
    table = {name: {"material": material, "tool": tool, **values, "source": f"fitted to {data}"}}
    return toml_text(table, comment).encode()
