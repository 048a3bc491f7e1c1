"""The result of a run that could not save one: from its raw record and what it left at its end."""

from __future__ import annotations

from pathlib import Path

from rds.results.result import Result


def from_record(directory: str | Path) -> Result:
    """The result in the record of `directory`, up to its last whole row.

    It has the columns that the loop recorded and no verdict: that needs the plan of the run. Raises InputError for a
    record that cannot be read.
    """
    # imported here: a saved result opens without the runtime
    from rds.runtime.record import read_record

    columns, units, meta = read_record(directory)
    meta["notes"] = [f"{note}, no verdict and no simulation" for note in meta["notes"]]
    if "program_line" in columns and len(columns["program_line"]):
        meta["notes"].append(f"the part program was in line {columns['program_line'][-1]:.0f}")
    return Result(columns, units, meta)
