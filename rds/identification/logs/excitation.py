"""Whether a log can tell anything: a command that varies, an axis that moves, both ways, at more than one speed."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil

import numpy as np

from rds.identification.logs.log import Finding, Gravity, Log
from rds.identification.logs.motion import motion, noise, travel
from rds.machines.machine import Axis

_FEW_STEPS = 20  # encoder steps of motion, and samples, below which a log tells nothing
_LEAST = 0.01  # of the windows
_LEVEL = 0.02  # of the largest command: what is nearer counts as the same level
_NOISY, _MOST_NOISE = 6.0, 0.2  # the same: standard deviations of a measured command's noise, and at most so much
_SHORT = 100  # samples
_ANY_STEPS = 3  # of a speed, below which it is constant
_WINDOWS = 8  # of a motion that starts
_AT_REST, _STEADY = 0.5, 0.3  # of the steady speed: the first one, and how far the later ones are apart
_BEGIN = 0.25  # of the steady speed: what an encoder's step may make of the first one
_PARTS = 4  # of the second half
_MOVED = 5.0  # encoder steps
_BEYOND_NOISE = 12.0  # standard deviations: noise alone spans 10.4 in 10^7 samples


def excitation(log: Log, axis: Axis | None) -> list[Finding]:
    """What the data leave unidentifiable, for want of excitation."""
    unit, volts = log.units.get("position", "mm"), log.units.get("command", "V")
    constant = np.ptp(log.command) == 0.0
    if constant and not _starts(log):
        what = f"the command is {log.command[0]:g} {volts} throughout: it excites nothing, and no gain can be told"
        return [Finding("excitation", what, Gravity.FAULT)]
    found = []
    if constant:
        what = (
            f"the command is {log.command[0]:g} {volts} throughout, and the axis starts under it: the log begins with "
            "its step. It tells a time constant and one steady speed; for gain and friction apart fit it together "
            "with logs of other levels, for a delay begin the log before the step"
        )
        found.append(Finding("excitation", what, Gravity.WARNING))
    reach = float(np.ptp(log.position))
    coarse = log.resolution is not None and reach < _FEW_STEPS * log.resolution
    if log.is_rate and coarse and reach > _ANY_STEPS * (log.resolution or 0.0):
        coarse = False
        what = (
            f"the speed takes {reach / (log.resolution or 1.0):.0f} steps of {log.resolution:.4g} {unit} in all: take "
            "its differences over more samples, or log the position as well"
        )
        found.append(Finding("quantization", what, Gravity.WARNING))
    if reach == 0.0 or coarse:
        steps = f" ({reach / log.resolution:.0f} encoder steps)" if log.resolution else ""
        what = f"the axis hardly moves: {reach:.4g} {unit}{steps} in all; give it a larger command"
        return [Finding("excitation", what, Gravity.FAULT)]
    if len(log) < _SHORT:
        what = f"it has only {len(log)} samples; intervals from so few are wide, if they hold at all"
        found.append(Finding("excitation", what, Gravity.WARNING))
    seen = motion(log)
    for way, word, sign in ((1.0, "positive", "+"), (-1.0, "negative", "-")):
        share = float(np.mean(way * seen.speed > seen.moves))
        if share < _LEAST and not _goes(log, way, reach):
            what = (
                f"the axis never moves in the {word} direction: the friction of that direction (F{sign}) cannot be told"
            )
            found.append(Finding("excitation", what, Gravity.WARNING))
    if has_one_level(log):
        what = (
            "the command has one level in each direction: from one steady speed the gain K and the friction cannot be "
            "told apart; use two amplitudes or more, or a signal that sweeps"
        )
        found.append(Finding("excitation", what, Gravity.WARNING))
    still = np.abs(seen.speed) < seen.moves
    driven = np.abs(seen.command) > _LEVEL * float(np.abs(log.command).max())
    if not (still & driven).any():
        what = "the axis never stands still against a command: the data say little about friction at standstill"
        found.append(Finding("excitation", what))
    return found


def has_one_level(log: Log) -> bool:
    """Whether the command changes and has one level in each direction: its steady speeds tell no gain by themselves."""
    command = log.command
    return bool(np.ptp(command) > 0.0) and _levels(command, 1.0) <= 1 and _levels(command, -1.0) <= 1


def steps_to_one_level(logs: Sequence[Log]) -> bool:
    """Whether each log goes from rest to one level of command and stays there, and all that go the same way go to the
    same: one speed each way. A log that stays at rest is passed over.
    """
    ways: dict[float, list[np.ndarray]] = {1.0: [], -1.0: []}
    for log in logs:
        changes = np.flatnonzero(np.diff(log.command))
        if is_at_rest(log):
            continue
        if len(changes) and log.command[0] != 0.0:
            return False
        after = log.command[changes[0] + 1 :] if len(changes) else log.command
        way = float(np.sign(after[-1]))
        if way == 0.0 or float((way * after).min()) <= 0.0:
            return False
        ways[way].append(after)
    return all(_levels(np.concatenate(parts), way) <= 1 for way, parts in ways.items() if parts)


def is_steady(log: Log) -> bool:
    """Whether an axis only goes on under a constant command: by itself it tells nothing, beside other logs a speed."""
    moves = bool(log.position.any()) if log.is_rate else bool(np.ptp(log.position) > 0.0)
    return moves and bool(np.ptp(log.command) == 0.0) and bool(log.command[0] != 0.0) and not _starts(log)


def is_at_rest(log: Log) -> bool:
    """Whether an axis stands still under a constant command: by itself it tells nothing, beside other logs friction."""
    return bool(np.ptp(log.command) == 0.0 and log.command[0] != 0.0 and np.ptp(log.position) == 0.0) and not (
        log.is_rate and log.position.any()
    )


def _starts(log: Log) -> bool:
    """Whether the axis goes from rest to a steady speed under a constant command: a step response without its begin.

    Speeds are means over so many windows that an encoder's steps do not matter.
    """
    seen = motion(log)
    speed = seen.speed
    if log.command[0] == 0.0 or len(speed) < _WINDOWS:
        return False
    late = speed[len(speed) // 2 :]
    last = abs(float(np.mean(late)))
    begin = min(max(ceil(seen.noise / (_BEGIN * last)), 1), len(speed) // _WINDOWS) if last > 0.0 else 1
    first = float(log.position[0] if log.is_rate else np.mean(speed[:begin]))
    parts = [float(np.mean(part)) for part in np.array_split(late, _PARTS)]
    return abs(first) < _AT_REST * last and float(np.ptp(parts)) < _STEADY * last


def _goes(log: Log, way: float, reach: float) -> bool:
    """Whether the position moves that way by more than noise and steps, however slowly; a speed tells by its sign."""
    if log.is_rate:
        return False
    least = max(_MOVED * (log.resolution or 0.0), _BEYOND_NOISE * noise(log.position), _LEAST * reach)
    return travel(log.position, way) > least


def _levels(command: np.ndarray, sign: float) -> int:
    """How many distinct levels the command takes in a direction, each for at least a hundredth of that time.

    What is no farther apart than noise of a measured command puts it is one level.
    """
    largest = float(np.abs(command).max())
    width = float(np.clip(_NOISY * _noise_of(command), _LEVEL * largest, _MOST_NOISE * largest))
    there = sign * command[sign * command > width]
    if len(there) == 0:
        return 0
    apart = np.rint((there - np.median(there)) / width).astype(int)
    counts = np.bincount(apart - apart.min())
    return int((counts > max(_LEAST * len(there), 1)).sum()) or 2


def _noise_of(command: np.ndarray) -> float:
    """The noise of a measured command; 0 for one that mostly stays as it is: what changes in it are its own steps."""
    return noise(command) if len(command) > 3 and np.median(np.abs(np.diff(command, 3))) > 0.0 else 0.0
