"""The jerk-limited move from point to point in the least time, by the `ruckig` package (extra `motion`).

Berscheid and Kröger, "Jerk-limited Real-time Trajectory Generation with Arbitrary Target States", RSS 2021. The axes
are phase-synchronised: they keep to the straight line where the states at both ends allow it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for


@dataclass(frozen=True)
class PointToPoint:
    """Samples T s apart: position (m, n) mm, velocity mm/s, acceleration mm/s² of n axes; `duration` of it all, s."""

    T: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    duration: float


def point_to_point(
    start: Sequence[float],
    end: Sequence[float],
    velocity: Sequence[float],
    acceleration: Sequence[float],
    jerk: Sequence[float],
    T: float,
    *,
    start_velocity: Sequence[float] | None = None,
    start_acceleration: Sequence[float] | None = None,
) -> PointToPoint:
    """From `start` to rest at `end`, within velocity, acceleration and jerk of each axis (mm/s, mm/s², mm/s³).

    The last sample is at rest on the end. Raises InputError for limits that are not more than 0 or states that cannot
    be, and where ruckig is not installed.
    """
    with needed_for("a jerk-limited move in the least time"):
        import ruckig
    n = len(start)
    if not T > 0.0:
        raise InputError(f"T = {T!r} must be more than 0 s")
    given = {"end": end, "velocity": velocity, "acceleration": acceleration, "jerk": jerk}
    for name, values in given.items():
        if len(values) != n or not np.isfinite(values).all():
            raise InputError(f"{name} = {tuple(values)} must be {n} finite numbers, one for each axis of the start")
        if name != "end" and not np.all(np.asarray(values) > 0.0):
            raise InputError(f"{name} = {tuple(values)} must each be more than 0")
    asked = ruckig.InputParameter(n)
    asked.current_position, asked.target_position = list(map(float, start)), list(map(float, end))
    asked.current_velocity = list(start_velocity or [0.0] * n)
    asked.current_acceleration = list(start_acceleration or [0.0] * n)
    asked.max_velocity, asked.max_acceleration = list(map(float, velocity)), list(map(float, acceleration))
    asked.max_jerk = list(map(float, jerk))
    asked.synchronization = ruckig.Synchronization.Phase
    found = ruckig.Trajectory(n)
    outcome = ruckig.Ruckig(n).calculate(asked, found)
    if outcome not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise InputError(f"no motion from {tuple(start)} to {tuple(end)} ({outcome}): check the states at the start")
    count = ceil(found.duration / T - 1e-9) + 1
    rows = np.array([found.at_time(min(k * T, found.duration))[:3] for k in range(count)])
    position, speeds, pushes = (rows[:, i].reshape(count, n) for i in range(3))
    position[-1], speeds[-1], pushes[-1] = end, 0.0, 0.0
    return PointToPoint(T, position, speeds, pushes, float(found.duration))
