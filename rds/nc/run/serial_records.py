"""What a run by methods A, B and C leaves for `rds report`: the path, and where the carriages were.

`path.csv` has a row for each segment of the programmed path, `gauges-METHOD.csv` one for each millisecond, in which the
dial gauges are read. The reports of dcs-thesis, chapter 5, read them (`rds.results.reports.gauges`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from math import degrees
from pathlib import Path
from typing import BinaryIO

from rds.core.atomic import write_files
from rds.nc.run.serial_methods import MethodRun
from rds.results.reports.gauges import GAUGES, LINEAR, PATH

SPEED = "spindle_rev_min"
_DECIMALS = 6  # of mm, s and degrees


def write_records(runs: Sequence[MethodRun], folder: Path) -> list[Path]:
    """Write the path of the runs' program and the readings of each run that was measured; returns the paths.

    InputError where the system refuses to write.
    """
    contents: dict[Path, Iterable[Iterable[float]]] = {folder / "path.csv": _path_rows(runs[0])}
    headings: dict[Path, Sequence[str]] = {folder / "path.csv": PATH}
    for run in runs:
        if len(run.time):
            place = folder / f"gauges-{run.method}.csv"
            contents[place] = _gauge_rows(run)
            headings[place] = (*GAUGES, SPEED) if len(run.speed) else GAUGES
    write_files({place: partial(_write, headings[place], rows) for place, rows in contents.items()})
    return list(contents)


def _path_rows(run: MethodRun) -> Iterable[Iterable[float]]:
    for number, row in enumerate(run.motion.prepared.path):
        yield [
            *(number, int(row["line"]), int(row["rapid"]), int(row["plane"])),
            *(float(value) for name in ("start", "end", "centre") for value in row[name][:3]),
            degrees(float(row["sweep"])),
        ]


def _gauge_rows(run: MethodRun) -> Iterable[Iterable[float]]:
    columns: Mapping[str, int] = {name: i for i, name in enumerate(run.motion.axes)}
    for number, (time, segment, row) in enumerate(zip(run.time, run.segment, run.position, strict=True)):
        yield [
            float(time),
            *(float(row[columns[name]]) if name in columns else 0.0 for name in LINEAR),
            int(segment),
            *(run.speed[number : number + 1].tolist()),
        ]


def _write(headings: Sequence[str], rows: Iterable[Iterable[float]], stream: BinaryIO) -> None:
    stream.write((",".join(headings) + "\n").encode())
    for row in rows:
        cells = (str(value) if isinstance(value, int) else f"{value:.{_DECIMALS}f}" for value in row)
        stream.write((",".join(cells) + "\n").encode())
