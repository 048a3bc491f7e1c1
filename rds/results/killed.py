"""The result of a run that could not save one: from its raw record and what it left at its end."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.core.types import Ending
from rds.results.result import Result


def from_record(directory: str | Path) -> Result:
    """The result in the record of `directory`, up to its last whole row.

    It has the columns that the loop recorded, times in µs, and no verdict: that needs the whole run. `ending` is
    what the run noted itself, else killed. Raises InputError for a record that cannot be read.
    """
    # imported here: a saved result opens without the runtime
    from rds.runtime.record import read_ending, read_raw

    about, rows = read_raw(directory)
    left = read_ending(directory)
    try:
        recorded = dict(zip(about["columns"], np.asarray(rows, dtype=float).T, strict=True))
        units = dict(about["units"])
        time = recorded.pop("sample") * about["sample_period"]
        axes, period, expected = about["axes"], about["sample_period"], about["samples"]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"its header lacks {error}; it was written by another version of rds") from error
    columns = {"time": time}
    for name, values in recorded.items():
        columns[name], units[name] = (values / 1e3, "µs") if units.get(name) == "ns" else (values, units.get(name, ""))
    meta = {
        "axes": axes,
        "sample_period": period,
        "duration": expected * period,
        "mode": about.get("mode"),
        "machine": about.get("machine"),
        "ending": left.get("ending", str(Ending.KILLED)),
        "ending_reason": left.get("reason", ""),
        "environment": left.get("environment", {}),
        "notes": [f"read from the run's raw record: {len(time)} of {expected} samples, no verdict and no simulation"],
    }
    return Result(columns, {name: units[name] for name in recorded}, meta)
