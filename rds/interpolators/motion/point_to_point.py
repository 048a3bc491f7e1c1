"""The jerk-limited move from point to point in the least time, by the `ruckig` package (extra `motion`).

Berscheid and Kröger, "Jerk-limited Real-time Trajectory Generation with Arbitrary Target States", RSS 2021. The axes
are phase-synchronised: they keep to the straight line where the states at both ends allow it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, inf
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for

_ATTEMPTS = 100  # to end a move on a sample: some durations are none that the axes can do together
_MOST = 20_000_000  # samples
_WHOLE = 1e-6  # of T


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
    end_velocity: Sequence[float] | None = None,
    end_acceleration: Sequence[float] | None = None,
) -> PointToPoint:
    """From `start` to `end`, within velocity, acceleration and jerk of each axis (mm/s, mm/s², mm/s³).

    Velocities (mm/s) and accelerations (mm/s²) at both ends are those given, and 0 without. The last sample is the end.
    A move that ends in motion takes as much longer than the least time as makes its duration a whole number of T, so
    that the next move begins at its last sample. Raises InputError for limits that are not more than 0, for states at
    the ends that they do not allow, and where ruckig is not installed.
    """
    with needed_for("a jerk-limited move in the least time"):
        import ruckig
    for name, values in {"start": start, "end": end, "velocity": velocity, "acceleration": acceleration}.items():
        _check_numbers(name, values)
    _check_numbers("jerk", jerk)
    n = len(start)
    if n == 0 or not np.isfinite(start).all():
        raise InputError(f"start = {tuple(start)} must be a finite number for each axis, and one axis or more")
    if not 0.0 < T < inf:
        raise InputError(f"T = {T!r} must be a finite number of s, more than 0")
    given = {"end": end, "velocity": velocity, "acceleration": acceleration, "jerk": jerk}
    for name, values in given.items():
        if len(values) != n or not np.isfinite(values).all():
            raise InputError(f"{name} = {tuple(values)} must be {n} finite numbers, one for each axis of the start")
        if name != "end" and not np.all(np.asarray(values) > 0.0):
            raise InputError(f"{name} = {tuple(values)} must each be more than 0")
    states = {
        "start_velocity": (start_velocity, [inf] * n),  # from beyond the limits it slows down
        "start_acceleration": (start_acceleration, [inf] * n),
        "end_velocity": (end_velocity, velocity),
        "end_acceleration": (end_acceleration, acceleration),
    }
    ends = {name: _state(name, values, most) for name, (values, most) in states.items()}
    _check_end(ends["end_velocity"], ends["end_acceleration"], velocity, jerk)
    asked = ruckig.InputParameter(n)
    asked.current_position, asked.target_position = list(map(float, start)), list(map(float, end))
    asked.current_velocity, asked.current_acceleration = ends["start_velocity"], ends["start_acceleration"]
    asked.target_velocity, asked.target_acceleration = ends["end_velocity"], ends["end_acceleration"]
    asked.max_velocity, asked.max_acceleration = list(map(float, velocity)), list(map(float, acceleration))
    asked.max_jerk = list(map(float, jerk))
    asked.synchronization = ruckig.Synchronization.Phase
    found = ruckig.Trajectory(n)
    moving = any(ends["end_velocity"]) or any(ends["end_acceleration"])
    for _ in range(_ATTEMPTS):
        try:
            outcome = ruckig.Ruckig(n).calculate(asked, found)
        except (ruckig.RuckigError, ValueError):  # it has no name for one, -101
            outcome = "beyond ruckig's arithmetic"
        if outcome not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise InputError(
                f"no motion from {tuple(start)} to {tuple(end)} ({outcome}): check limits and the states at both ends"
            )
        if found.duration / T > _MOST:
            raise InputError(
                f"T = {T:g} s makes more than {_MOST:,} samples of a move of {found.duration:g} s; give more"
            )
        count = ceil(found.duration / T - 1e-9) + 1
        if not moving or abs(found.duration - (count - 1) * T) <= _WHOLE * T:
            break
        asked.minimum_duration = (count - 1) * T
    else:
        raise InputError(f"no motion from {tuple(start)} to {tuple(end)} in a whole number of samples; change T")
    rows = np.array([found.at_time(min(k * T, found.duration))[:3] for k in range(count)])
    position, speeds, pushes = (rows[:, i].reshape(count, n) for i in range(3))
    position[-1], speeds[-1], pushes[-1] = end, ends["end_velocity"], ends["end_acceleration"]
    return PointToPoint(T, position, speeds, pushes, float(found.duration))


def _check_numbers(name: str, values: Any) -> None:
    try:
        is_row = np.ndim(np.asarray(values, dtype=float)) == 1
    except (TypeError, ValueError):
        is_row = False
    if not is_row or isinstance(values, str):
        raise InputError(f"{name} = {values!r:.60} must be a list of numbers, one for each axis, as in (0.0, 30.0)")


def _state(name: str, values: Sequence[float] | None, most: Sequence[float]) -> list[float]:
    """The velocities or accelerations at an end. Raises InputError for those beyond the limits."""
    if values is not None:
        _check_numbers(name, values)
    found = [0.0] * len(most) if values is None else [float(value) for value in values]
    within = len(found) == len(most) and np.isfinite(found).all() and bool(np.all(np.abs(found) <= most))
    if not within:
        limits = "" if inf in most else f" within {tuple(most)}"
        remedy = "" if inf in most else f"; give less, or allow more {name.removeprefix('end_')}"
        raise InputError(
            f"{name} = {tuple(found)} must be {len(most)} finite numbers{limits}, one for each axis{remedy}"
        )
    return found


def _check_end(speeds: list[float], pushes: list[float], most: Sequence[float], jerk: Sequence[float]) -> None:
    """InputError for an end that an axis comes to from beyond its velocity: v − a|a| / (2 j), where a was last 0."""
    for k, (v, a, j) in enumerate(zip(speeds, pushes, jerk, strict=True)):
        before = v - a * abs(a) / (2.0 * j)
        if abs(before) > most[k]:
            raise InputError(
                f"axis {k + 1} can end with {v:g} mm/s and {a:g} mm/s² only after {before:.4g} mm/s, which is beyond "
                f"its velocity of {most[k]:g} mm/s; give less end_acceleration, or more jerk"
            )
