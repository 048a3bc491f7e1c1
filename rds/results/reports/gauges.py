"""A part program's path, and where the carriages were on it: the files that `rds nc run --method` writes.

`path.csv` is recognized by its columns among the files of a report; all others are readings, a row for each instant.
The `plane` of a segment is -1 for a straight move, 0 for an arc in XY, 1 in ZX, 2 in YZ; `sweep` is positive
counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.reading import Column, read_columns

LINEAR = ("X", "Y", "Z")
PATH = (
    *("segment", "line", "rapid", "plane"),
    *(f"{what}_{axis}_mm" for what in ("start", "end", "centre") for axis in "xyz"),
    "sweep_deg",
)
GAUGES = ("time_s", "x_mm", "y_mm", "z_mm", "segment")
STRAIGHT = -1
_IN_PLANE = ((0, 1), (2, 0), (1, 2))


@dataclass(frozen=True)
class Segment:
    """One of the path: positions in mm (3), the sweep in degrees."""

    line: int
    rapid: bool
    plane: int
    start: np.ndarray
    end: np.ndarray
    centre: np.ndarray
    sweep: float

    @property
    def across(self) -> list[int]:
        """The two axes of an arc's plane."""
        return list(_IN_PLANE[self.plane])

    @property
    def radius(self) -> float:
        """Of an arc, mm."""
        return float(np.hypot(*(self.start - self.centre)[self.across]))


@dataclass(frozen=True)
class Readings:
    """Where the carriages were: `time` (n, s), `position` (n × 3, mm), `segment` (n), which of the path."""

    name: str
    time: np.ndarray
    position: np.ndarray
    segment: np.ndarray

    def within(self, number: int) -> np.ndarray:
        """The positions on one segment (m × 3)."""
        found: np.ndarray = self.position[self.segment == number]
        return found


def read_gauges(files: Sequence[Path]) -> tuple[list[Segment], list[Readings]]:
    """The path and all readings. InputError if either is missing, or does not belong to the other."""
    tables = {path: {column.heading: column for column in read_columns(path)} for path in files}
    paths = [path for path, columns in tables.items() if set(PATH) <= set(columns)]
    if len(paths) != 1:
        raise InputError(
            f"{len(paths) or 'none'} of the files {'is a path' if len(paths) < 2 else 'are paths'}; this report needs "
            "one path.csv and the gauges-*.csv that `rds nc run PROGRAM --method A,B,C --out FOLDER` writes"
        )
    segments = _path(tables.pop(paths[0]))
    if not tables:
        raise InputError("there is a path and no readings on it; name a gauges-*.csv, too", str(paths[0]))
    return segments, [_readings(path, columns, len(segments)) for path, columns in tables.items()]


def _path(columns: dict[str, Column]) -> list[Segment]:
    table = np.column_stack([columns[name].numbers(1) for name in PATH])
    found = []
    for number, row in enumerate(table):
        if row[0] != number or row[3] not in (STRAIGHT, 0, 1, 2):
            raise InputError(
                f"row {number + 1} says segment {row[0]:g} in plane {row[3]:g}; segments count from 0, and planes are "
                "-1 (straight), 0, 1 and 2",
                columns["segment"].where,
            )
        found.append(Segment(int(row[1]), bool(row[2]), int(row[3]), row[4:7], row[7:10], row[10:13], float(row[13])))
    return found


def _readings(path: Path, columns: dict[str, Column], segments: int) -> Readings:
    if missing := [name for name in GAUGES if name not in columns]:
        raise InputError(f"there is no column {missing[0]}; readings have {', '.join(GAUGES)}", str(path))
    time, x, y, z, at = (np.array(columns[name].numbers()) for name in GAUGES)
    if np.any(np.diff(time) <= 0.0):
        raise InputError("its times do not grow from row to row; readings are in the order of time", str(path))
    if at.min() < 0 or at.max() >= segments or np.any(at != np.rint(at)):
        raise InputError(
            f"it speaks of segment {at.max():g}, and the path has {segments}; take the path.csv of the same run",
            str(path),
        )
    return Readings(path.stem.removeprefix("gauges-"), time, np.column_stack([x, y, z]), at.astype(int))
