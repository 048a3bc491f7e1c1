"""The coordinated motion of three-axis-mill: velocities held through corners, all axes in the same stage.

The Master gives each move a deadline, its length over the feed, at least 8 sample periods; each axis finds the velocity
with which it arrives by then ("Motion Profile", "Coordinated Movement", figures 10, 11 and 13). A move begins with the
stage *accel*, in which each axis goes from the velocity that it has to its own of this move; then *cruise*; and if the
corner is not blended, *decel* to rest. With blending, the velocity is held until the target is reached, and the change
to the next velocity, up or down, comes after it: so the corner is passed at speed, and what leaves the line is the
start of the next move, which is curved.

Blending is off for all axes if any axis would turn back. The thesis asks whether an axis's next displacement has the
opposite sign; here an axis also may not come to a stop or swing beyond its target in the next *accel*, which would turn
it back as well. Stages last whole sample periods, so that every target is met at a sample, by all axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, isfinite

import numpy as np

from rds.core.errors import InputError

ACCEL, CRUISE, DECEL = 0, 1, 2
SHORTEST = 8  # sample periods of a deadline
SAME = 1e-7  # mm: targets that are closer are the same


@dataclass(frozen=True)
class BlendedMotion:
    """Samples T s apart: position (m, n) mm, velocity mm/s, acceleration mm/s², for n axes; stage and move of each (m).

    A sample's velocity, acceleration and stage are those after it. held (moves): whether the corner after a move is
    blended. targets: the sample at which each target is met.
    """

    T: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    stage: np.ndarray
    move: np.ndarray
    held: np.ndarray
    targets: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """s."""
        return self.T * np.arange(len(self.position))

    @property
    def speed(self) -> np.ndarray:
        """mm/s along the path."""
        return np.linalg.norm(self.velocity, axis=1)


def blended(
    points: Sequence[Sequence[float]] | np.ndarray,
    feed: float | Sequence[float],
    T: float,
    *,
    share: float = 0.25,
    blend: bool = True,
) -> BlendedMotion:
    """The motion through `points` (moves + 1, axes; mm) at `feed` (mm/s; one for all moves, or one each), every T s.

    share: AccPeriod, the part of the deadline that a change of velocity takes, from 0 to 0.5 (chosen: the thesis prints
    no value). Without `blend` every move stops at its target. The speed along a line is at most the feed. Raises
    InputError for fewer than 2 different points, and for a feed, period or share that cannot be.
    """
    feeds = np.atleast_1d(np.array(feed, dtype=float))
    if not (np.isfinite(feeds).all() and (feeds > 0.0).all() and isfinite(T) and T > 0.0):
        raise InputError(f"feed = {feed!r} mm/s and T = {T!r} s must each be more than 0")
    if not 0.0 < share <= 0.5:
        raise InputError(f"share = {share!r} must be more than 0 and at most 0.5 (of a move's deadline)")
    try:
        through = np.array(points, dtype=float)
    except (TypeError, ValueError):  # rows of different lengths, too
        through = np.empty(0)
    if through.ndim != 2 or not np.isfinite(through).all():
        raise InputError("points must be rows of finite positions, one row for each point and one column for each axis")
    if len(feeds) not in (1, len(through) - 1):
        raise InputError(f"{len(feeds)} feeds for {len(through) - 1} moves; give one for all, or one for each")
    moves = np.linalg.norm(np.diff(through, axis=0), axis=1) >= SAME
    through, feeds = through[np.insert(moves, 0, True)], np.broadcast_to(feeds, moves.shape)[moves]
    if len(through) < 2:
        raise InputError("the points are all the same; give at least two that differ")
    ways = np.diff(through, axis=0)
    deadlines = np.maximum(np.linalg.norm(ways, axis=1) / feeds, SHORTEST * T)
    ramps = np.ceil(share * deadlines / T - 1e-9) * T  # duration of each move's accel and decel
    entry = np.zeros(through.shape[1])
    stages: list[tuple[int, int, float, np.ndarray, np.ndarray]] = []  # move, stage, duration, velocity at its ends
    held = np.zeros(len(ways), dtype=bool)
    for k, way in enumerate(ways):
        last = k == len(ways) - 1
        steady, cruise = 0.0, entry
        for hold in (True, False):
            if hold and (last or not blend or (way * ways[k + 1] < 0.0).any()):
                continue
            steady, cruise = _cruise(way, entry, deadlines[k], ramps[k], hold, T)
            swings = not last and (np.abs(cruise) * ramps[k + 1] / 2.0 >= np.abs(ways[k + 1])) & (cruise != 0.0)
            if hold and np.any(swings):
                continue
            held[k] = hold
            break
        stages.append((k, ACCEL, ramps[k], entry, cruise))
        if steady > 0.0:
            stages.append((k, CRUISE, steady, cruise, cruise))
        entry = cruise if held[k] else np.zeros_like(cruise)
        if not held[k]:
            stages.append((k, DECEL, ramps[k], cruise, entry))
    return _sampled(through, stages, held, T)


def _cruise(
    way: np.ndarray, entry: np.ndarray, deadline: float, ramp: float, hold: bool, T: float
) -> tuple[float, np.ndarray]:
    """Duration of the cruise, and each axis's velocity in it: all arrive together, none above its share of the feed."""
    wanted = way / deadline
    moving = way != 0.0
    ratio = min(1.0, float((entry[moving] / wanted[moving]).min()))
    steady = deadline - 0.5 * ramp * (1.0 + ratio) - (0.0 if hold else 0.5 * ramp)
    steady = max(ceil(steady / T - 1e-9), 0) * T
    return steady, (way - 0.5 * ramp * entry) / (0.5 * ramp + steady + (0.0 if hold else 0.5 * ramp))


def _sampled(
    through: np.ndarray, stages: list[tuple[int, int, float, np.ndarray, np.ndarray]], held: np.ndarray, T: float
) -> BlendedMotion:
    parts: list[tuple[np.ndarray, ...]] = []
    here, targets, count = through[0], np.zeros(len(held), dtype=int), 0
    for k, (move, stage, duration, u, w) in enumerate(stages):
        n = round(duration / T)
        push = (w - u) / duration
        t = T * np.arange(n)[:, None]
        rows = np.ones((n, 1))
        parts.append((here + u * t + 0.5 * push * t**2, u + push * t, rows * push, np.full(n, stage), np.full(n, move)))
        count += n
        here = here + 0.5 * (u + w) * duration
        if k + 1 == len(stages) or stages[k + 1][0] != move:
            here, targets[move] = through[move + 1], count  # without what rounding left
    zero = np.zeros((1, through.shape[1]))
    parts.append((through[-1:], zero, zero, np.array([DECEL]), np.array([len(held) - 1])))
    position, velocity, acceleration, stage_of, move_of = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    return BlendedMotion(T, position, velocity, acceleration, stage_of, move_of, held, targets)
