"""Methods A, B and C beside each other: contour errors, steps lost, and what they ask of the line, in one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.nc.run.serial_methods import MethodRun
from rds.results.reports.content import Report, Table

if TYPE_CHECKING:
    from rds.core.figure import Picture

COLUMNS = (
    "method",
    "contour error, max [µm]",
    "contour error, RMS [µm]",
    "commanded, max [µm]",
    "steps off",
    "time [s]",
    "pauses [s]",
    "bytes of the host",
    "load [%]",
    "late frames",
    "answers missed",
)
_DIGITS = dict.fromkeys(COLUMNS[1:4], 2) | {"time [s]": 2, "pauses [s]": 2, "load [%]": 2}
_NOTE = (
    "Contour error: of the carriage from the programmed path, by a dial gauge, in feeds (rapids where there are "
    "none). Commanded: the same of the steps sent. Steps off: sent less made, where the motion ended. Pauses: while "
    "buffers were filled. Load: share of the time in which the host's wires, or the CAN bus, are busy."
)
_LATE = 0.01  # share of late frames that is worth a sentence
WORDS = {
    "A": "each period a frame",
    "B": "equations of segments",
    "C": "cyclic buffer",
    "B-free": "the same, each by its own clock",
    "C-free": "the same, each by its own clock",
    "C-thesis": "buffers of 1500, a byte a step",
}


def methods_report(runs: Sequence[MethodRun], file: Path, settings: Mapping[str, Any]) -> Report:
    """The runs as a table, a picture of the errors over time, and sentences."""
    rows = [_row(run) for run in runs]
    measured = [run for run in runs if len(run.error)]
    said = []
    if measured:
        best = min(measured, key=lambda run: float(run.error.max()))
        said.append(f"Method {best.method} keeps nearest to the path: {best.error.max() * 1e3:.2f} µm at most.")
    for run in runs:
        said += _losses(run)
    return Report(
        kind="methods",
        title=f"{file.name} on {settings['machine']} by method{'s' * (len(runs) > 1)} "
        f"{', '.join(run.method for run in runs)}",
        sources=[str(file)],
        settings=settings,
        tables=[Table("Methods", COLUMNS, rows, _NOTE, _DIGITS)],
        figures={"contour": lambda: _picture(measured)} if measured else {},
        findings=[*said, *dict.fromkeys(note for run in runs for note in run.motion.notes)],
    )


def _losses(run: MethodRun) -> list[str]:
    """What the host sent late, what the line lost, and what the motors did."""
    said, course = [], run.course
    if course.late > _LATE * course.steps:
        said.append(
            f"Method {run.method}: the host sent {course.late} of {course.steps} frames late, which makes steps longer "
            "and shorter than planned: see to what else keeps this computer busy, or take B or C, which go by the "
            "nodes' clocks."
        )
    if off := _counts(run.astray):
        said.append(
            f"Method {run.method}: steps that the units were sent and did not get: {off} ({course.missing} answers "
            "missed): frames were damaged or lost on the line. Home the axes; see to the cable, its shield and the "
            "baud rate, or take B or C, which send again what is lost."
        )
    steppers = {name: count for name, count in run.lost.items() if name in run.astray}  # servo motors have encoders
    motors = {name: count - run.astray[name] for name, count in steppers.items()}
    if lost := _counts(motors):
        said.append(f"Method {run.method} ends with steps lost by motors: {lost}; nobody on the line knows.")
    return said


def _counts(steps: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in steps.items() if count)


def _row(run: MethodRun) -> list[Any]:
    course = run.course
    error = run.error * 1e3 if len(run.error) else None
    return [
        f"{run.method}: {WORDS[run.method]}",
        None if error is None else float(error.max()),
        None if error is None else float(np.sqrt(np.mean(error**2))),
        float(run.path_error.max() * 1e3) if len(run.path_error) else None,
        ", ".join(f"{name} {count}" for name, count in run.lost.items()) or None,
        course.ended - course.begun,
        course.pauses,
        run.bytes,
        100.0 * run.load,
        course.late,
        course.missing,
    ]


def _picture(runs: Sequence[MethodRun]) -> Picture:
    from rds.core.figure import CYCLE, Picture, dress, legend

    picture = Picture(1.2 + 1.3 * len(runs))
    for axes, run, colour in zip(
        np.atleast_1d(picture.subplots(len(runs), 1, sharex=False)), runs, CYCLE * len(runs), strict=False
    ):
        axes.plot(np.arange(len(run.error)) * 1e-3, run.error * 1e3, color=colour, label=f"method {run.method}")
        dress(axes, "contour error [µm]", "time in feeds [s]" if run is runs[-1] else None)
        legend(axes)
    return picture
