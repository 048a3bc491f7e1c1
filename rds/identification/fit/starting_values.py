"""Values to begin a fit of the axis with, from the data alone.

Where the sign of the velocity is known (from the smoothed position), the axis is linear. With τ given,

    y = y₀ + v₀ τ (1 - e^(-t/τ)) + K·P[m u] - F₊·P[s₊] - F₋·P[s₋],      P = 1 / (p (τ p + 1)),    p = d/dt

where m is 1 while the axis moves, and s₊, s₋ are 1 while it moves forward or backward. So K, F₊, F₋ follow from
linear regression of the measured position itself, without any derivative of it, and τ from a grid: this stays usable
where noise or quantization makes an acceleration worthless.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain
from math import exp, expm1

import numpy as np

from rds.core.compiling import kernel
from rds.core.errors import InputError
from rds.identification.fit.smoothing import Motion, motion_of
from rds.identification.fit.stick_grid import stick_starts
from rds.identification.logs.log import Log, excited_part

GRID = 13  # time constants that are tried
MOST_SAMPLES = 200_000  # of each log: more say nothing new about where to begin

# Where options begin: small beside what they stand beside, but not 0, where some have no derivative.
_BEGIN = {"viscous": 0.0, "stribeck": 0.1, "dead_zone": 0.01, "offset": 0.0}


def axis_starts(
    logs: Sequence[Log], names: Sequence[str], states: int
) -> Iterator[tuple[dict[str, float], list[tuple[float, ...]]]]:
    """Values of the parameters `names` and each log's initial state, the likeliest first, made as they are asked for.

    InputError where no log holds any motion, or no voltage that differs from 0.
    """
    whole = [motion_of(log) for log in logs]
    _check_excitation(logs, whole)
    parts = [excited_part(log, MOST_SAMPLES) for log in logs]
    motions = [motion_of(part) for part in parts]
    longest = max(float(part.time[-1] - part.time[0]) for part in parts)
    finest = min(part.sample_period for part in parts)
    grid = np.geomspace(0.5 * finest, max(0.1 * longest, 2.0 * finest), GRID)
    costs, solutions = _regressions(parts, motions, grid)
    minima = [i for i in range(GRID) if costs[i] <= costs[max(i - 1, 0)] and costs[i] <= costs[min(i + 1, GRID - 1)]]
    minima.sort(key=lambda i: float(costs[i]))
    begins = [_initial_state(log, motion, states) for log, motion in zip(logs, whole, strict=True)]
    first, *rest = ((solutions[i], float(grid[i])) for i in minima[:2])
    for solved, tau in chain([first], stick_starts(parts), rest):
        yield _values(solved, tau, names, parts, motions), begins


def rate_starts(
    logs: Sequence[Log], names: Sequence[str]
) -> Iterator[tuple[dict[str, float], list[tuple[float, ...]]]]:
    """The same for logs of a speed: those of the way that it makes, which has no step of an encoder."""
    ways = [_way(log) for log in logs]
    motions = [motion_of(way) for way in ways]
    begins: list[tuple[float, ...]] = [(_initial_state(way, m, 2)[1],) for way, m in zip(ways, motions, strict=True)]
    for values, _ in axis_starts(ways, names, 2):
        yield values, begins


def _way(log: Log) -> Log:
    steps = np.diff(log.time) * 0.5 * (log.position[1:] + log.position[:-1])
    way = np.concatenate([[0.0], np.cumsum(steps)])
    return replace(log, position=way, resolution=None, units={**log.units, "position": ""})


def _check_excitation(logs: Sequence[Log], motions: Sequence[Motion]) -> None:
    if not any(motion.moves for motion in motions):
        log = logs[0]
        unit = log.units.get("position", "mm")
        raise InputError(
            f"the axis never moves: its position stays within {np.ptp(log.position):.3g} {unit}, which noise and "
            "quantization explain; there is nothing to estimate from. Record a log in which the voltage overcomes "
            "friction both ways",
            log.name,
        )
    if all(not np.any(log.command) for log in logs):
        raise InputError(
            "the command is 0 throughout while the axis moves; map the column of the voltage that moved it",
            logs[0].name,
        )


def _initial_state(log: Log, motion: Motion, states: int) -> tuple[float, ...]:
    speed = float(motion.velocity[0])
    moving = abs(speed) > motion.threshold
    return (float(log.position[0]), speed if moving else 0.0, 0.0)[:states]


def _values(
    solved: np.ndarray, tau: float, names: Sequence[str], logs: Sequence[Log], motions: Sequence[Motion]
) -> dict[str, float]:
    K, plus, minus = (float(value) for value in solved)
    fastest = max(float(np.abs(motion.velocity).max()) for motion in motions)
    slightly = 0.01 * fastest
    # a direction in which it never moves leaves 0: the other's level is the better guess
    plus = plus if plus > 0.0 else max(-minus, slightly)
    minus = minus if minus < 0.0 else -max(plus, slightly)
    step = max((log.resolution or motion.noise) for log, motion in zip(logs, motions, strict=True))
    begin = _BEGIN | {
        "tau": tau,
        "K": K,
        "friction_plus": plus,
        "friction_minus": minus,
        "friction": 0.5 * (plus - minus),
        "stribeck_velocity": 0.1 * fastest,
        "delay": 0.5 * logs[0].sample_period,
        "backlash": 2.0 * step,
    }
    if "offset" in names and K:
        begin["offset"] = -0.5 * (plus + minus) / K
    if "stribeck" in names:
        begin |= {name: begin[name] / 1.05 for name in ("friction_plus", "friction_minus", "friction")}
    return {name: begin[name] for name in names}


def _regressions(logs: Sequence[Log], motions: Sequence[Motion], grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums of squares (taus), and K, F₊, F₋ in the least-squares sense for each time constant (taus, 3); 0 for what
    never occurs.
    """
    gram = np.zeros((len(grid), 4, 4))
    for log, motion in zip(logs, motions, strict=True):
        v = motion.velocity
        forward, backward = v > motion.threshold, v < -motion.threshold
        products = _products(log.time, log.command, log.position, forward, backward, grid)
        # each log has an initial position and velocity of its own: what they explain is taken out first
        own, across, shared = products[:, :2, :2], products[:, :2, 2:], products[:, 2:, 2:]
        gram += shared - np.swapaxes(across, 1, 2) @ np.linalg.pinv(own, rcond=1e-9, hermitian=True) @ across
    scale = np.sqrt(np.maximum(np.diagonal(gram, axis1=1, axis2=2)[:, :3], 0.0))
    used = scale > 1e-9 * np.maximum(scale.max(axis=1, keepdims=True), 1e-300)
    inverse = np.where(used, 1.0, 0.0) / np.where(used, scale, 1.0)
    A = gram[:, :3, :3] * inverse[:, :, None] * inverse[:, None, :]
    b = gram[:, :3, 3] * inverse
    solved = (np.linalg.pinv(A, rcond=1e-9, hermitian=True) @ b[:, :, None])[:, :, 0] * inverse
    costs = gram[:, 3, 3] - 2.0 * (solved * gram[:, :3, 3]).sum(axis=1)
    costs += (solved * (gram[:, :3, :3] @ solved[:, :, None])[:, :, 0]).sum(axis=1)
    return costs, solved * np.array([1.0, -1.0, -1.0])


@kernel
def _products(t, u, y, forward, backward, taus):
    """Sums of products (taus, 6, 6) of 1, the responses of the initial velocity, m u, s₊ and s₋, and the position."""
    sums, row = np.zeros((len(taus), 6, 6)), np.zeros(6)
    row[0] = 1.0
    every = max(1, len(t) // 2500)  # of the sums: neighbouring samples say the same of where to begin
    for number in range(len(taus)):
        tau, own = taus[number], sums[number]
        # responses and their velocities as single numbers, which stay in the processor's registers
        coasted, moved, plus, minus = 0.0, 0.0, 0.0, 0.0
        v, v_plus, v_minus = 0.0, 0.0, 0.0
        step, decay, reach, left = -1.0, 1.0, 0.0, 1.0
        wait = 0
        for k in range(len(t)):
            wait -= 1
            if wait < 0:
                wait = every - 1
                row[1], row[2], row[3], row[4], row[5] = coasted, moved, plus, minus, y[k] - y[0]
                for i in range(6):
                    one = row[i]
                    for j in range(i, 6):
                        own[i, j] += one * row[j]
            if k + 1 == len(t):
                break
            if abs(t[k + 1] - t[k] - step) > 1e-12:
                step = t[k + 1] - t[k]
                decay = exp(-step / tau)
                reach = -tau * expm1(-step / tau)
            coasted += left * reach
            left *= decay
            ahead, back = forward[k], backward[k]
            force = u[k] if ahead or back else 0.0
            moved += force * step + (v - force) * reach
            v = force + (v - force) * decay
            force = 1.0 if ahead else 0.0
            plus += force * step + (v_plus - force) * reach
            v_plus = force + (v_plus - force) * decay
            force = 1.0 if back else 0.0
            minus += force * step + (v_minus - force) * reach
            v_minus = force + (v_minus - force) * decay
        for i in range(6):
            for j in range(i):
                own[i, j] = own[j, i]
    return sums
