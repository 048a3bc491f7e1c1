"""From a file of logged data to logs: `read_log(path)`.

Our own results explain themselves. For other files a map says what the columns mean: given, or lying beside the file as
FILE.map.toml, or guessed where names and units leave no doubt.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from rds.core.errors import InputError
from rds.core.progress import Progress
from rds.identification.logs.log import Log
from rds.identification.logs.map import LogMap, beside
from rds.identification.logs.table import Table
from rds.machines.machine import Machine


def read_log(
    path: str | Path, mapping: LogMap | str | Path | None = None, progress: Progress | None = None
) -> list[Log]:
    """The logs in a file or in the folder of a result: one for each axis (and stretch, where gaps split it).

    `mapping`: a map or the path of one. Each log carries findings about its data. InputError, with the place, the value
    and the remedy, for a file or map that cannot be read, a meaning that is in doubt (with a map to paste), cells
    that are no numbers, and times that are not as regular as the map demands.
    """
    if not isinstance(path, str | PathLike):
        said = (
            f"a {type(path).__name__} is no file; save it, as pandas does by to_parquet('log.parquet'), and name that"
        )
        raise InputError(said)
    path = Path(path)
    chosen = choose_map(path, mapping)
    if chosen is None and is_own(path):
        return own_logs(path)
    table = table_of(path, chosen, progress)
    return logs_of(table, chosen or guessed(table))


def choose_map(path: Path, mapping: LogMap | str | Path | None) -> LogMap | None:
    """The map that is given, or that lies beside the file; None where there is none."""
    if isinstance(mapping, LogMap):
        return mapping
    found = Path(mapping) if mapping is not None else beside(path)
    return LogMap.read(found) if found is not None else None


def is_own(path: Path) -> bool:
    """Whether it is one of our own results."""
    from rds.identification.logs.result_log import is_result

    return is_result(path)


def own_logs(path: Path) -> list[Log]:
    """The logs in one of our own results, with the findings about their data."""
    import hashlib

    from rds.identification.logs.findings import with_findings
    from rds.identification.logs.result_log import logs_of_result
    from rds.results import open_result

    result = open_result(path)
    if path.is_file():
        with open(path, "rb") as stream:
            sha256 = hashlib.file_digest(stream, "sha256").hexdigest()
    else:  # of a folder, which holds the table in several formats: the columns themselves
        digest = hashlib.sha256()
        for name, values in result.columns.items():
            digest.update(name.encode() + b"\0" + values.tobytes())
        sha256 = digest.hexdigest()
    machine = _machine(result.meta.get("machine"))
    name = path.resolve().parent.name if path.stem in ("result", "record") else path.stem if path.suffix else path.name
    logs = logs_of_result(result, name, str(path), sha256)
    axes = [log.name.rpartition(":")[2] if ":" in log.name else result.axes[0] for log in logs]
    return [
        with_findings(log, machine.axes.get(axis) if machine else None) for log, axis in zip(logs, axes, strict=True)
    ]


def table_of(path: Path, mapping: LogMap | None, progress: Progress | None = None) -> Table:
    """The columns of the file, read as the map says."""
    from rds.identification.logs.tables import read_table

    if mapping is None:
        return read_table(path, progress=progress)
    table = read_table(path, mapping.delimiter, mapping.decimal, mapping.dbc, progress)
    where = str(mapping.path or path)
    if mapping.dbc and table.format != "can" and mapping.second is None:
        raise InputError(f"[bus] dbc is for a bus log, and {path.name} is none; remove it", where)
    if (mapping.delimiter or mapping.decimal) and table.format != "csv":
        raise InputError(f"[table] is for text, and {path.name} is none; remove it", where)
    return table


def guessed(table: Table) -> LogMap:
    """The map that the columns' names and units make certain; InputError with a draft to paste where they do not."""
    from rds.identification.logs.guess import draft, guess, map_path

    found = guess(table)
    if found.map is not None:
        return found.map
    if not found.is_log:
        raise InputError(found.problem, str(table.path))
    left_out = "".join(f"; {finding.what}" for finding in table.findings if finding.what.startswith("left out"))
    raise InputError(
        f"{found.problem}{left_out}; correct these lines and save them as {map_path(table.path).name} beside it "
        f"(or `rds data describe FILE --write-map`):\n\n{draft(table)}",
        str(table.path),
    )


def logs_of(table: Table, mapping: LogMap) -> list[Log]:
    """The logs of each axis in the map, with findings."""
    from rds.identification.logs.axis_log import axis_logs
    from rds.identification.logs.second_file import SecondFile, read_second

    second: SecondFile | None = read_second(table, mapping) if mapping.second is not None else None
    try:
        return [log for axis in mapping.axes.values() for log in axis_logs(table, mapping, axis, second)]
    except InputError as error:
        if mapping.path is not None or "the map" not in str(error):
            raise
        made = f"`rds data describe {table.path.name} --write-map` writes a map, which this file has not yet"
        raise InputError(f"{error}. {made}") from None


def _machine(name: object) -> Machine | None:
    from rds.machines import load_machine

    try:
        return load_machine(str(name))
    except InputError:
        return None
