"""Steps of the voltage in a log, and what a ruler reads from each: gain, 63.2 % time, dead time.

A step is a voltage that stays what it is for some samples, after another. Of an axis only the part of a step counts in
which friction is one number: from rest, or on in the same direction, all of it (an *onset*); when the axis turns, what
comes after it has turned (a *tail*).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rds.identification.logs.log import Log

_SAME = 0.01  # of the command's range: what counts as a constant voltage
_SHORTEST = 12  # samples
_AFTER_TURN = 4  # samples after the turn that are left out: the axis may have stuck there
_SETTLED = 0.02  # of a step: how much the last quarter may still drift


@dataclass(frozen=True)
class Window:
    """Samples `first` to before `end` of a log, all at `voltage` (V), reached from `before` (V; None at the start).

    `way` is +1 or -1, the direction in which the axis ends. In a tail the axis has turned, and the onset is not seen.
    """

    first: int
    end: int
    voltage: float
    before: float | None
    way: int
    tail: bool


@dataclass(frozen=True)
class Reading:
    """What is read off one step that settles, by the rules of thumb.

    The speed has covered 28.3 % and 63.2 % of its change at t₂₈ and t₆₃: τ = 1.5 (t₆₃ - t₂₈), dead time t₆₃ - τ.
    """

    at: float  # s, when the voltage changed
    gain: float  # speed step over voltage step
    tau: float  # s
    dead_time: float  # s
    t63: float  # s after the step


def find_windows(log: Log, is_rate: bool) -> list[Window]:
    """The steps of a log that tell something; none for a voltage that never rests, or an axis that does not move."""
    u, y = log.command, log.position
    scale = float(np.ptp(u)) or float(np.abs(u).max())
    if scale == 0.0:
        return []
    jumps = np.flatnonzero(np.abs(np.diff(u)) > _SAME * scale) + 1
    edges = [0, *jumps.tolist(), len(u)]
    windows = []
    for number, (first, end) in enumerate(pairwise(edges)):
        # the sample at which the next voltage begins still belongs to this one: the output lags by a sample
        last = min(end + 1, len(u))
        if end - first < _SHORTEST or np.ptp(u[first:end]) > _SAME * scale:
            continue
        voltage = float(u[first:end].mean())
        before = float(u[first - 1]) if number else None
        if is_rate:
            if np.abs(y[first:last]).max() > 2.0 * (log.resolution or 0.0):  # at rest, friction answers any voltage
                windows.append(Window(first, last, voltage, before, 1, False))
            continue
        found = _axis_window(log.time, y, first, last, log.resolution or 0.0)
        if found is not None:
            begin, way, tail = found
            windows.append(Window(begin, last, voltage, before, way, tail))
    return windows


def _axis_window(t: np.ndarray, y: np.ndarray, first: int, end: int, step: float) -> tuple[int, int, bool] | None:
    """Where the useful part begins, which way the axis ends, and whether it turned; None where it stands."""
    late = slice(end - max((end - first) // 3, 4), end)
    moved = float(y[end - 1] - y[late.start])
    if abs(moved) <= 3.0 * step or moved == 0.0:
        return None
    way = 1 if moved > 0.0 else -1
    part = way * y[first:end]
    turn = int(np.argmin(part))
    if part[0] - part[turn] <= 2.0 * step:
        return first, way, False
    begin = first + turn + _AFTER_TURN
    return (begin, way, True) if end - begin >= _SHORTEST else None


def read_step(log: Log, window: Window, is_rate: bool) -> Reading | None:
    """The rules of thumb on one step; None where they do not apply: it does not settle, or turns, or has no before."""
    if window.tail or window.before is None:
        return None
    t = log.time[window.first : window.end] - log.time[window.first]
    speed = log.position[window.first : window.end]
    if not is_rate:
        speed, t = _smoothed_rate(log, window)
    quarter = max(len(speed) // 4, 3)
    start, final = float(speed[0]), float(speed[-quarter:].mean())
    size = final - start
    drift = float(speed[-quarter:][-quarter // 2 :].mean() - speed[-quarter:][: quarter // 2].mean())
    if size == 0.0 or abs(drift) > _SETTLED * abs(size):
        return None
    share = (speed - start) / size
    t28, t63 = (_crossing(t, share, part) for part in (1.0 - np.exp(-1.0 / 3.0), 1.0 - np.exp(-1.0)))
    if t28 is None or t63 is None or not t63 > t28:
        return None
    tau = 1.5 * (t63 - t28)
    change = window.voltage - window.before
    return Reading(float(log.time[window.first]), size / change, tau, t63 - tau, t63)


def _smoothed_rate(log: Log, window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Velocity by differences over a few samples, and the times of its middle since the step."""
    span = max((window.end - window.first) // 40, 1)
    y, t = log.position[window.first : window.end], log.time[window.first : window.end]
    rate = (y[span:] - y[:-span]) / (t[span:] - t[:-span])
    middle = 0.5 * (t[span:] + t[:-span]) - t[0]
    return np.concatenate([[_rate_before(log, window.first, span)], rate]), np.concatenate([[0.0], middle])


def _rate_before(log: Log, first: int, span: int) -> float:
    begin = max(first - span, 0)
    if begin == first:
        return 0.0
    return float((log.position[first] - log.position[begin]) / (log.time[first] - log.time[begin]))


def _crossing(t: np.ndarray, share: np.ndarray, level: float) -> float | None:
    """When `share` first stays above `level`, between samples; None if never or from the beginning."""
    above = np.flatnonzero(share >= level)
    if not len(above) or above[0] == 0:
        return None
    k = int(above[0])
    rise = float(share[k] - share[k - 1])
    return float(t[k - 1] + (level - share[k - 1]) / rise * (t[k] - t[k - 1]))
