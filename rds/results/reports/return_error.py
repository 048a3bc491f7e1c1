"""Return error: how far from where it began a program ends that comes back to its start.

Source: dcs-thesis, section 5.5, experiment I, figures 5.8 and 5.9, table 5.2: rapid moves out and back under a dial
gauge, without a deviation that could be read on it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.gauges import LINEAR, Readings, read_gauges
from rds.results.reports.settings import Setting

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "tolerance": Setting("return error that is allowed; half a BLU of the STARMILL", "mm", 0.005, more_than=0),
}
_SAME = 1e-6  # mm


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """The return error of each run. InputError for a path that does not come back, or data that will not do."""
    path, runs = read_gauges(files)
    gap = path[-1].end - path[0].start
    if np.abs(gap).max() > _SAME:
        away = ", ".join(f"{name} {value:g}" for name, value in zip(LINEAR, gap, strict=True))
        gap_said = f"the path does not come back to its start: it ends {away} mm from it"
        raise InputError(f"{gap_said}; end the program where it begins", str(files[0]))
    columns = ["run", *(f"return error {name} [µm]" for name in LINEAR), "together [µm]"]
    columns += ["farthest out [mm]", "time [s]", "in the thesis"]
    rows = [_row(run) for run in runs]
    note = "Where the carriages stand after the program, less where they stood before it."
    return Report(
        "return-error",
        "Return error",
        [file.name for file in files],
        settings,
        [Table("Return error", columns, rows, note, dict.fromkeys(columns[1:5], 1) | dict.fromkeys(columns[5:7], 2))],
        {"way": lambda: _picture(runs)},
        [_finding(run, settings["tolerance"]) for run in runs],
    )


def _error(run: Readings) -> np.ndarray:
    found: np.ndarray = run.position[-1] - run.position[0]
    return found


def _row(run: Readings) -> list[Any]:
    error = _error(run) * 1e3
    out = float(np.linalg.norm(run.position - run.position[0], axis=1).max())
    together = float(np.linalg.norm(error))
    return [run.name, *(float(value) for value in error), together, out, float(np.ptp(run.time)), "not significant"]


def _finding(run: Readings, tolerance: float) -> str:
    error = float(np.linalg.norm(_error(run)))
    verdict = "within" if error <= tolerance else "more than"
    return f"{run.name}: it comes back to {error * 1e3:.1f} µm, {verdict} the {tolerance * 1e3:g} µm allowed."


def _picture(runs: Sequence[Readings]) -> Picture:
    """Each axis over time, less where it began."""
    from rds.core.figure import CYCLE, Picture, dress, legend

    drawn = Picture(0.8 + 2.4 * len(runs))
    for axes, run in zip(np.atleast_1d(drawn.subplots(len(runs), 1)), runs, strict=True):
        for name, colour, values in zip(LINEAR, CYCLE, (run.position - run.position[0]).T, strict=False):
            axes.plot(run.time, values, color=colour, label=name)
        dress(axes, f"{run.name}: from the start [mm]")
        legend(axes)
    return drawn
