"""Whether a column goes on from row to row as a time does."""

from __future__ import annotations

import numpy as np

from rds.identification.logs.table import Column
from rds.identification.logs.units import factor

RISING = 0.9  # of the steps of a time go up


def is_coarse(column: Column) -> bool:
    """Whether the values go up, and stay the same between."""
    steps = np.diff(column.values[np.isfinite(column.values)])
    return len(steps) > 0 and float(steps.min()) == 0.0 and float(steps.max()) > 0.0


def begins_anew(column: Column) -> bool:
    """Whether the values go up, and begin with the first one again."""
    there = column.values[np.isfinite(column.values)]
    again = np.flatnonzero(np.diff(there) < 0.0) + 1
    return len(again) > 0 and bool(np.all(there[again] == there[0]))


def are_alike(a: Column, b: Column) -> bool:
    """Whether two columns have the same unit and numbers."""
    return a is b or (a.unit == b.unit and np.allclose(a.values, b.values, rtol=1e-12, atol=1e-9, equal_nan=True))


def go_on_alike(a: Column, b: Column) -> bool:
    """Whether two times go on by the same, to a hundredth of the sample period at each row."""
    one, other = (c.values * factor(str(c.unit), "s") for c in (a, b))
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return False
    return bool(np.all(np.abs((one - one[0]) - (other - other[0])) < 0.01 * np.median(np.diff(other))))


def rises(values: np.ndarray) -> bool:
    """Whether most steps go up."""
    steps = np.diff(values[:100_000])
    return len(steps) > 0 and bool(np.mean(steps > 0.0) >= RISING)


def is_even(values: np.ndarray) -> bool:
    """Whether all steps are alike, as of the time in the first row of a matrix that Simulink has saved."""
    steps = np.diff(values[:100_000])
    return len(steps) > 0 and bool(np.all(np.abs(steps - np.median(steps)) < 1e-3 * abs(np.median(steps))))
