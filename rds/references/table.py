"""A signal from the rows of a CSV file: time,value or time,position,velocity,acceleration.

Between rows of time,value a voltage runs straight, and a reference follows the cubic spline through the rows, whose
derivatives are its velocity and acceleration. `interpolation` takes one rule for both: "spline", "linear" (the
velocity is the slope, the acceleration 0) or "hold" (steps; velocity and acceleration 0). Rows that carry velocity and
acceleration are joined by the polynomials of fifth degree that have them. Before the first and after the last
row the axis stands still at that row's value.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.references.rows import read_rows
from rds.references.signal import Motion, Signal

INTERPOLATIONS = ("spline", "linear", "hold")
_EDGE = 1e-9  # of the distance to it: from there on a row, or a period, counts as reached, as sample times are rounded


def table_signal(file: str | Path, interpolation: str | None = None, period: float | None = None) -> Signal:
    """The signal of the rows of `file`; with `period` (s) they repeat. Raises InputError naming file and line."""
    if interpolation is not None and interpolation not in INTERPOLATIONS:
        raise InputError(
            f"user: interpolation = {interpolation!r} is not known; known ones: {', '.join(INTERPOLATIONS)}"
        )
    rows = read_rows(file)
    times, values = rows[:, 0], rows[:, 1]
    if period is not None and times[-1] - times[0] > period * (1.0 + 1e-9):
        raise InputError(
            f"the rows last {times[-1] - times[0]:g} s, longer than period = {period:g} s; give a longer one", str(file)
        )
    settings = {"file": str(file), "interpolation": interpolation, "period": period}
    if rows.shape[1] == 4:
        if interpolation is not None:
            raise InputError(
                f"interpolation = {interpolation!r} is for rows of time,value; these carry velocity and acceleration",
                str(file),
            )
        inside: Callable[[np.ndarray], Motion] = partial(_polynomial, pieces=_quintic(rows))
        voltage_inside = inside
    else:
        inside = _between(interpolation or "spline", times, values)
        voltage_inside = _between(interpolation or "linear", times, values)
    motion = partial(_motion, inside=inside, times=times, values=values, period=period)
    voltage = partial(_motion, inside=voltage_inside, times=times, values=values, period=period)
    return Signal("user", motion, period, settings, partial(_position, motion=voltage))


def _position(t: np.ndarray, motion: Callable[[np.ndarray], Motion]) -> np.ndarray:
    return motion(t)[0]


def _motion(
    t: np.ndarray,
    inside: Callable[[np.ndarray], Motion],
    times: np.ndarray,
    values: np.ndarray,
    period: float | None,
) -> Motion:
    if period is not None:  # a sample that should be at a beginning is not taken for the end before it
        periods = np.floor((t - times[0]) / period + _EDGE)
        t = times[0] + np.maximum(t - times[0] - periods * period, 0.0)
    within = (t >= times[0]) & (t <= times[-1])
    still = np.where(t < times[0], values[0], values[-1])
    position, velocity, acceleration = inside(np.clip(t, times[0], times[-1]))
    return np.where(within, position, still), np.where(within, velocity, 0.0), np.where(within, acceleration, 0.0)


def _between(interpolation: str, times: np.ndarray, values: np.ndarray) -> Callable[[np.ndarray], Motion]:
    if interpolation == "hold":
        return partial(_hold, times=times, values=values)
    if interpolation == "linear":
        return partial(_linear, times=times, values=values)
    with needed_for("a spline through rows", 'say interpolation = "linear" or "hold"'):
        from scipy.interpolate import CubicSpline

    return partial(_polynomial, pieces=CubicSpline(times, values))


def _row_before(t: np.ndarray, times: np.ndarray) -> np.ndarray:
    edge = _EDGE * np.min(np.diff(times))
    return np.clip(np.searchsorted(times, t + edge, side="right") - 1, 0, len(times) - 1)


def _hold(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> Motion:
    return values[_row_before(t, times)], np.zeros_like(t), np.zeros_like(t)


def _linear(t: np.ndarray, times: np.ndarray, values: np.ndarray) -> Motion:
    slopes = np.append(np.diff(values) / np.diff(times), 0.0)
    return np.interp(t, times, values), slopes[_row_before(t, times)], np.zeros_like(t)


def _quintic(rows: np.ndarray) -> Any:
    with needed_for("joining rows of time,position,velocity,acceleration"):
        from scipy.interpolate import BPoly

    return BPoly.from_derivatives(rows[:, 0], rows[:, 1:])


def _polynomial(t: np.ndarray, pieces: Any) -> Motion:
    return pieces(t), pieces(t, 1), pieces(t, 2)
