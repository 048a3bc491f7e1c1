"""A log at a glance: command, position, speed and the steps of the time, with where the first faults are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rds.core.figure import BLUE, GREEN, GREY, ORANGE, VERMILLION, Picture, dress, legend, quantity
from rds.identification.logs.log import Gravity, Log
from rds.identification.logs.motion import motion

_POINTS = 4_000  # drawn of a line: each is the lowest or highest of a stretch
_REGULAR = 1.0  # %: the least that the plot of the steps shows to either side, so that rounding looks like none
_MOST = 4  # logs side by side


def overview(logs: Sequence[Log]) -> Picture:
    """One column of plots for each log, of the first four."""
    shown = list(logs[:_MOST])
    picture = Picture(height=9.0, width=10.0 if len(shown) == 1 else 6.0 * len(shown))
    table = picture.subplots(4, len(shown), sharex="col", squeeze=False, height_ratios=(2, 2, 2, 1))
    for log, (command, position, speed, clock) in zip(shown, table.T, strict=True):
        command.set_title(log.name)
        command.plot(*thin(log.time, log.command), color=BLUE, linewidth=1.0, label="command")
        if log.voltage_range is not None and log.units.get("command") == "V":
            for limit in log.voltage_range:
                if abs(limit) < 3.0 * float(np.abs(log.command).max()):
                    command.axhline(limit, color=GREY, linestyle="--", linewidth=0.8)
        unit = log.units.get("position", "mm")
        if "reference" in log.extra:
            position.plot(
                *thin(log.time, log.extra["reference"]), color=GREY, linewidth=3.0, alpha=0.55, label="reference"
            )
        position.plot(*thin(log.time, log.position), color=BLUE, linewidth=1.0, label="measured")
        seen = motion(log)
        middle = log.time[: len(seen.speed) * seen.width : seen.width] + 0.5 * seen.width * log.sample_period
        what = f"speed [{unit if log.is_rate else f'{unit}/s'}]"
        speed.plot(*thin(middle, seen.speed), color=GREEN, linewidth=1.0, label=f"means over {seen.width} samples")
        off = 100.0 * (np.diff(log.time) / log.sample_period - 1.0)
        clock.plot(*thin(log.time[1:], off), color=ORANGE, linewidth=0.8)
        reach = max(_REGULAR, 1.1 * float(np.abs(off).max()))
        clock.set_ylim(-reach, reach)
        for finding in log.findings:
            if finding.sample is not None and finding.gravity is not Gravity.NOTE and finding.sample < len(log):
                for axes in (command, position):
                    axes.axvline(log.time[finding.sample], color=VERMILLION, linewidth=0.8, linestyle=":")
        dress(command, f"command [{log.units.get('command', 'V')}]", None)
        dress(position, quantity("axis", unit), None)
        dress(speed, what, None)
        dress(clock, "step off the\nperiod [%]")
        legend(position)
        legend(speed)
    return picture


def thin(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As many points as a picture shows: the lowest and the highest of each stretch, so that no peak is lost."""
    if len(values) <= _POINTS:
        return time, values
    length = -(-len(values) // (_POINTS // 2))
    count = len(values) // length
    stretches = values[: count * length].reshape(count, length)
    ends = np.sort(np.stack([stretches.argmin(axis=1), stretches.argmax(axis=1)], axis=1), axis=1)
    at = (ends + np.arange(count)[:, None] * length).reshape(-1)
    return time[at], values[at]
