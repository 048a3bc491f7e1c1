"""A table from elsewhere, made into a result as far as it goes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rds.core.errors import InputError
from rds.results.header import Contents
from rds.results.units import split_heading

_TIME = ("time", "t")
_MEASURED = "_measured"


def from_table(table: Mapping[str, np.ndarray]) -> Contents:
    """A result from columns headed like `time [s]`, `X_measured [mm]`, with nothing else known about the run.

    Needs `time` (or `t`) in s and at least one column `<axis>_measured`; the axes are those that have one. The
    sample period is the median step of time. Raises InputError otherwise; units are never converted.
    """
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    for head, values in table.items():
        name, unit = split_heading(head)
        name = "time" if name in _TIME else name
        if name in columns:
            raise InputError(f"two columns are called {name!r}; rename one")
        columns[name] = values
        if unit is not None:
            units[name] = unit
    axes = [name.removesuffix(_MEASURED) for name in columns if name.endswith(_MEASURED) and name != _MEASURED]
    if "time" not in columns or not axes:
        raise InputError(
            f"it is not a result: it needs a column 'time' (s) and one such as 'X_measured' (mm) per axis; "
            f"it has {', '.join(table) or 'none'}"
        )
    if units.get("time", "s") != "s":
        raise InputError(f"time is in {units['time']!r}; a result has it in s: convert the column")
    steps = np.diff(columns["time"])
    if not len(steps) or not np.median(steps) > 0:
        raise InputError("it has too few samples, or a time that does not increase, to tell its sample period")
    period = float(np.median(steps))
    # 0.2 - 0.1 is not 0.1: a step that is a decimal to within rounding is meant to be that decimal
    period = float(f"{period:.9g}")
    return Contents(columns, units, {"axes": axes, "sample_period": period})
