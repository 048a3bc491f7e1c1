"""The voltage that a model needs for the motion that was measured, beside the voltage that was given.

The inverse of a model without its equations: over each block of samples, started from the state measured at its
beginning, the model lands on the position measured at its end if its command is given a constant extra δ. The voltage
error of the block is δ, found by the secant method. It does not build up as a position's error does, and feedback does
not hide it. Blocks in which the axis hardly moves are left out: there, friction answers any voltage.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from rds.core.extras import needed_for
from rds.identification.logs.log import Log
from rds.identification.structures.structure import PLAY, Blocks, Structure

_BLOCKS = 400  # at most; of a longer log, blocks spread evenly
_ROUNDS = 12
_STEPS_OF_ENCODER = 5  # a block's motion must be more than so many, or its length is not known to 10 %
_TRIAL = 0.02  # of the command's largest size: the first other voltage
_SETTLE = (0.25, 1.0, 4.0, 16.0)  # s, of a constant voltage until the velocity is steady
_STEP = 0.005  # s, at most
_FAR = 10.0 / _TRIAL  # trials: ten times the largest command is no voltage that an axis needs


@dataclass(frozen=True)
class NeededVoltage:
    """Blocks of a log: `time` (s, their middle), mean `velocity` (mm/s) and `command` (V) given, and the `extra` V.

    `relative_percent` is 100 |extra| / |command| over the blocks (Euclidean norms); None where there are too few.
    """

    block: int  # samples
    time: np.ndarray
    velocity: np.ndarray
    command: np.ndarray
    extra: np.ndarray
    left_out: int  # blocks: at rest, or with no voltage that does it

    @property
    def relative_percent(self) -> float | None:
        """100 |extra| / |command|."""
        given = float(np.linalg.norm(self.command))
        return 100.0 * float(np.linalg.norm(self.extra)) / given if len(self.extra) >= 3 and given > 0.0 else None

    @property
    def rmse(self) -> float | None:
        """Root mean square of the extra voltage, V."""
        return float(np.sqrt(np.mean(self.extra**2))) if len(self.extra) >= 3 else None


def needed_voltage(
    log: Log, structure: Structure, values: Mapping[str, float], velocity: np.ndarray, block: int, is_rate: bool
) -> NeededVoltage:
    """The extra voltage per block of `block` samples; `velocity` (mm/s) is the log's own, smoothed, at each sample.

    With `is_rate` (a spindle) the output is the speed itself, and the state begins at it.
    """
    given, values = _acting(log, structure, values)
    count = (len(log) - 1) // block
    chosen = np.unique(np.linspace(0, count - 1, min(count, _BLOCKS)).astype(int)) if count > 0 else np.empty(0, int)
    least = _STEPS_OF_ENCODER * (log.resolution or 0.0)
    trial = _TRIAL * max(float(np.abs(log.command).max()), 1e-6)
    rows = (chosen * block)[:, None] + np.arange(block + 1)
    position, speed = log.position[rows], velocity[rows]
    moved = position[:, -1] - position[:, 0]
    size = np.abs(position).max(axis=1, initial=0.0) if is_rate else np.abs(moved)
    kept = (size > least) & (size > 0.0)
    if not is_rate:  # where the axis turns, the way is short and friction's part of it large
        kept &= (speed * np.sign(moved)[:, None] > 0.0).all(axis=1)
    rows, position, speed, moved = rows[kept], position[kept], speed[kept], moved[kept]
    states = np.zeros((len(rows), structure.states))
    states[:, 0] = position[:, 0]
    if not is_rate and structure.states > 1:
        states[:, 1] = speed[:, 0]
    if PLAY in structure.state_names[: structure.states]:
        states[:, structure.state_names.index(PLAY)] = np.sign(moved)  # it moves that way, pushed by the motor
    blocks = Blocks(rows[:, 0].copy(), block, states, position[:, -1].copy(), trial, _FAR * trial, _ROUNDS)
    lands = structure.lands or partial(_lands, structure)
    extra = lands(log.time, given, blocks, values)
    found = np.isfinite(extra)
    rows = rows[found]
    return NeededVoltage(
        block,
        time=log.time[rows[:, 0] + block // 2],
        velocity=speed[found].mean(axis=1),
        command=given[rows[:, :-1]].mean(axis=1),
        extra=extra[found],
        left_out=len(chosen) - len(rows),
    )


def _acting(log: Log, structure: Structure, values: Mapping[str, float]) -> tuple[np.ndarray, Mapping[str, float]]:
    """The mean command that acts in each sample, and the parameters with which it acts at once.

    A block knows nothing of the commands before it, and they act in its first samples where there is a delay.
    """
    delay = 0.0 if structure.sensitivities is None else values.get("delay", 0.0)  # a file of one's own has its own
    if delay == 0.0:
        return log.command, values
    t, u = log.time, log.command
    sums = np.concatenate([[0.0], np.cumsum(u[:-1] * np.diff(t))])
    late = t - delay
    until = np.interp(late, t, sums) + u[0] * np.minimum(late - t[0], 0.0)
    return np.append(np.diff(until) / np.diff(t), u[-1]), {**values, "delay": 0.0}


def _lands(
    structure: Structure, t: np.ndarray, u: np.ndarray, blocks: Blocks, values: Mapping[str, float]
) -> np.ndarray:
    """The constant extra voltage of each block; NaN where none is found near."""
    found = np.full(len(blocks.firsts), np.nan)
    for number, first in enumerate(blocks.firsts.tolist()):
        part = slice(first, first + blocks.length + 1)
        state, end = blocks.states[number].tolist(), float(blocks.ends[number])
        extra = _extra(structure, values, t[part], u[part], state, end, blocks)
        found[number] = np.nan if extra is None else extra
    return found


def _extra(
    structure: Structure,
    values: Mapping[str, float],
    t: np.ndarray,
    u: np.ndarray,
    state: list[float],
    end: float,
    how: Blocks,
) -> float | None:
    """The constant extra voltage with which the model ends at `end`; None where none is found near."""

    def miss(extra: float) -> float:
        with np.errstate(all="ignore"):
            return float(structure.respond(t, u + extra, state, values)[-1]) - end

    a, b = 0.0, how.trial
    at_a, at_b = miss(a), miss(b)
    for _ in range(how.rounds):
        if not (np.isfinite(at_a) and np.isfinite(at_b)) or at_a == at_b:
            return None  # it sticks, or is unstable: the voltage makes no difference
        a, at_a, b = b, at_b, b - at_b * (b - a) / (at_b - at_a)
        if abs(b) > how.far:
            return None
        if abs(b - a) <= 1e-6 * how.trial:
            return b
        at_b = miss(b)
    return b if abs(at_b) <= 1e-3 * abs(end - state[0]) else None


def static_curve(
    structure: Structure, values: Mapping[str, float], voltages: np.ndarray, is_rate: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Steady velocities (mm/s) of the model at constant voltages, and these voltages; (n,) each.

    Found by holding each voltage until the velocity no longer changes, 16 s at most. Where the model does not settle or
    does not move, the voltage is left out.
    """
    found = []
    for voltage in voltages:
        speed = _steady(structure, values, float(voltage), is_rate)
        if speed is not None and np.isfinite(speed) and speed != 0.0:
            found.append((speed, float(voltage)))
    table = np.array(found, dtype=float).reshape(len(found), 2)
    return table[:, 0], table[:, 1]


def _steady(structure: Structure, values: Mapping[str, float], voltage: float, is_rate: bool) -> float | None:
    for seconds in _SETTLE:
        t = np.linspace(0.0, seconds, max(101, round(seconds / _STEP)))
        with np.errstate(all="ignore"):
            u, rest = np.full(len(t), voltage), [0.0] * structure.states
            y = np.asarray(structure.respond(t, u, rest, values), dtype=float)
        v = y if is_rate else np.diff(y) / np.diff(t)
        if not np.isfinite(v).all():
            return None
        if abs(v[-1] - v[-len(v) // 10]) <= 1e-3 * abs(v[-1]):
            return float(v[-1])
    return None


def smoothed_velocity(log: Log, window: int, is_rate: bool) -> np.ndarray:
    """The log's velocity at each sample by local quadratics over about `window` samples; a speed is its own."""
    with needed_for("a velocity from a log"):
        from scipy.signal import savgol_filter

    if is_rate:
        return log.position
    length = max(2 * (window // 2) + 1, 5)
    length = min(length, len(log) - (1 - len(log) % 2))
    steps = np.diff(log.time)
    period = log.sample_period
    if np.abs(steps - period).max() <= 1e-9 * period:  # a filter of the time would give the period
        return savgol_filter(log.position, length, 2, deriv=1, delta=period)
    return savgol_filter(log.position, length, 2, deriv=1) / savgol_filter(log.time, length, 2, deriv=1)
