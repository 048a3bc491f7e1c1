"""Responses of a speed loop, from the table of a run: rise time, overshoot and mean speed at each level.

A level is a stretch of constant reference velocity that lasts. The rise is from 10 % to 90 % of the change of the
measured speed; the overshoot, and the error of the mean over the second half of the time to the next change, are
relative to the level. Source: section 9.2 and figure 8 of the paper on the control of modular reconfigurable machines
(docs/experiments.md).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.results.reports.content import Report, Table
from rds.results.reports.reading import read_columns
from rds.results.reports.settings import Setting

if TYPE_CHECKING:
    from rds.core.figure import Picture

SETTINGS = {
    "axis": Setting("whose speed; else the first of the table", text=True),
    "pulse": Setting("way of one pulse, axis units; speeds are then in pulses/s", more_than=0),
    "window": Setting("over which the speed is measured", "s", 0.02, more_than=0),
    "level": Setting("least time for which a level lasts", "s", 0.5, more_than=0),
}


@dataclass(frozen=True)
class Level:
    """The response to one level: s, and speeds in the report's unit; None where the speed did not get so far."""

    start: float  # when the reference begins to change
    speed: float
    rise: float | None
    overshoot: float  # %
    mean: float | None

    @property
    def error(self) -> float | None:
        """Of the mean, %."""
        return None if self.mean is None or self.speed == 0.0 else 100.0 * (self.mean - self.speed) / self.speed


@dataclass(frozen=True)
class Response:
    """One run: times, reference and measured speed, and its levels."""

    name: str
    t: np.ndarray
    reference: np.ndarray
    speed: np.ndarray
    levels: list[Level]


def report(files: Sequence[Path], settings: Mapping[str, Any]) -> Report:
    """Levels of each run. InputError for a table without a speed as reference, or without levels."""
    responses = [_response(path, settings) for path in files]
    unit = "pulses/s" if settings["pulse"] else "unit/s"
    columns = [
        "run",
        "from [s]",
        f"level [{unit}]",
        "rise time [s]",
        "overshoot [%]",
        f"mean [{unit}]",
        "mean error [%]",
    ]
    rows = [
        [r.name, level.start, level.speed, level.rise, level.overshoot, level.mean, level.error]
        for r in responses
        for level in r.levels
    ]
    digits = {columns[1]: 2, columns[2]: 1, columns[3]: 3, columns[4]: 2, columns[5]: 1, columns[6]: 2}
    note = "Rise from 10 % to 90 % of the change; the mean is over the second half of the time to the next change."
    return Report(
        "speed",
        "Responses of a speed loop",
        [path.name for path in files],
        settings,
        [Table("Levels of the speed", columns, rows, note, digits)],
        {"Speed": lambda: picture(responses, unit)},
        [_finding(r, level, unit) for r in responses for level in r.levels],
    )


def _response(path: Path, settings: Mapping[str, Any]) -> Response:
    found = {column.name: column for column in read_columns(path)}
    ending = "_reference_velocity"
    axes = [name.removesuffix(ending) for name in found if name.endswith(ending)]
    if not axes or "time" not in found:
        raise InputError(f"it has no columns time and X{ending}; give the result.csv of a run", str(path))
    axis = settings["axis"] or axes[0]
    if axis not in axes:
        raise InputError(f"axis = {axis!r} is not in the table; it has {', '.join(axes)}", str(path))
    t, reference, position = (
        np.array(found[name].numbers()) for name in ("time", f"{axis}{ending}", f"{axis}_measured")
    )
    if not (np.diff(t) > 0.0).all():
        raise InputError("its times do not increase; give the table of one run", str(path))
    scale = settings["pulse"] or 1.0
    reference, speed = reference / scale, _measured(t, position, settings["window"]) / scale
    levels = _levels(t, reference, speed, settings["level"])
    if not levels:
        said = f"its reference velocity stays nowhere for {settings['level']:g} s other than at 0"
        raise InputError(f"{said}; give a run with a `speed` reference", str(path))
    return Response(path.parent.name or path.stem, t, reference, speed, levels)


def _measured(t: np.ndarray, position: np.ndarray, window: float) -> np.ndarray:
    """The speed as the difference of positions over `window` s, about each time; of one side at the ends."""
    before, after = np.clip(t - 0.5 * window, t[0], t[-1]), np.clip(t + 0.5 * window, t[0], t[-1])
    way = np.interp(after, t, position) - np.interp(before, t, position)
    speed: np.ndarray = way / (after - before)
    return speed


def _levels(t: np.ndarray, reference: np.ndarray, speed: np.ndarray, least: float) -> list[Level]:
    same = np.isclose(np.diff(reference), 0.0, atol=1e-9 * np.abs(reference).max())
    changes = np.flatnonzero(~same) + 1
    starts, ends = np.append(0, changes), np.append(changes, len(t))
    levels, left, base = [], 0, 0.0
    for start, end in zip(starts, ends, strict=True):
        value = float(reference[start])
        if t[end - 1] - t[start] >= least:
            if value != base:
                levels.append(_level(t, speed, left, int(end), base, value))
            left, base = int(end) - 1, value
    return levels


def _level(t: np.ndarray, speed: np.ndarray, first: int, end: int, base: float, value: float) -> Level:
    """The level `value` that follows `base`, between two samples."""
    part = (speed[first:end] - base) / (value - base)
    began, rose = (np.flatnonzero(part >= share) for share in (0.1, 0.9))
    rise = float(t[first + rose[0]] - t[first + began[0]]) if rose.size else None
    mean = float(speed[(first + end) // 2 : end].mean()) if rose.size else None
    overshoot = max(0.0, 100.0 * (float(part.max()) - 1.0) * abs((value - base) / value)) if value else 0.0
    return Level(float(t[first]), value, rise, overshoot, mean)


def _finding(response: Response, level: Level, unit: str) -> str:
    if level.rise is None or level.mean is None:
        return f"{response.name}: the speed does not reach 90 % of the way to {level.speed:g} {unit}."
    error = f" ({level.error:+.2f} %)" if level.error is not None else ""
    numbers = f"rise time {1e3 * level.rise:.0f} ms, overshoot {level.overshoot:.1f} %, mean {level.mean:.1f} {unit}"
    return f"{response.name}: {level.speed:g} {unit} from {level.start:.2f} s: {numbers}{error}."


def picture(responses: Sequence[Response], unit: str) -> Picture:
    """Reference and measured speed over time, a panel per run."""
    from rds.core.figure import BLACK, CYCLE, Picture, dress, legend

    drawn = Picture(2.4 * len(responses) + 0.4)
    grid = drawn.subplots(len(responses), 1, squeeze=False)[:, 0]
    for axes, response in zip(grid, responses, strict=True):
        axes.plot(response.t, response.reference, "--", color=BLACK, linewidth=1.0, label="reference")
        axes.plot(response.t, response.speed, color=CYCLE[0], linewidth=1.5, label="measured")
        dress(axes, f"{response.name} [{unit}]", "time [s]" if axes is grid[-1] else None)
        legend(axes)
    drawn.align_ylabels()
    return drawn
