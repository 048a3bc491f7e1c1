"""A user's own signal: a function of time, or a file of rows (`rds.references.table`).

A function gives the value alone, or position, velocity and acceleration. From the value alone the other two are the
derivatives of the polynomial of fourth degree through five values 1 ms apart, about the time in question (from 0
onwards near the start, so that the function is not asked for negative times): for a smooth function
their error falls with the third power of that 1 ms or faster; a jump of the function becomes a peak of a few ms.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.blame import student_error
from rds.core.errors import ContractError, InputError
from rds.core.quantities import Choice, Quantity, Text
from rds.references.signal import Motion, Signal
from rds.references.table import INTERPOLATIONS, table_signal

PERIOD = Quantity("time after which the signal repeats", "s", above=0.0)
OPTIONS = {
    "file": Text("CSV file of time and value, or of time, position, velocity and acceleration"),
    "period": PERIOD,
    "interpolation": Choice("how the rows are joined", INTERPOLATIONS),
}
_STEP = 1e-3  # s
_POWERS = np.arange(5)
_TO_POLYNOMIAL = np.linalg.inv(np.vander(np.arange(5.0), increasing=True))  # values at 0, 1, .. 4 -> coefficients


def user(
    function: Callable[[float], Any] | None = None,
    file: str | Path | None = None,
    period: float | None = None,
    interpolation: str | None = None,
) -> Signal:
    """The signal of `function(t)`, or of the CSV `file` (see `rds.references.table.table_signal`).

    `function` takes a time in s and returns a value (V or mm) or (position, velocity, acceleration). `period` (s)
    says that the signal repeats; a file's rows are then repeated. Raises InputError for both or neither, for an
    impossible option or file, and, when evaluated, ContractError for a function whose answer is not finite numbers.
    """
    if (function is None) == (file is None):
        raise InputError("user: give either a function of time or a file of time and value, and not both")
    if period is not None:
        period = PERIOD.check(period, "period", "user")
    if file is not None:
        if not isinstance(file, str | Path):
            raise InputError(f"user: file = {file!r} must be the name of a CSV file, as text")
        return table_signal(file, interpolation, period)
    if interpolation is not None:
        raise InputError(f"user: interpolation = {interpolation!r} is for a file; a function has its own values")
    if not callable(function):
        raise InputError(f"user: function = {function!r} must be a function of time (s)")
    name = getattr(function, "__name__", type(function).__name__)
    motion = partial(_function_motion, function=function, name=name)
    voltage = partial(_function_values, function=function, name=name)
    return Signal("user", motion, period, {"function": name}, voltage)


def _function_values(t: np.ndarray, function: Callable[[float], Any], name: str) -> np.ndarray:
    return np.array([_answer(function, time, name)[0] for time in t.tolist()])


def _function_motion(t: np.ndarray, function: Callable[[float], Any], name: str) -> Motion:
    rows = [_answer(function, time, name) for time in t.tolist()]
    if any(len(row) != len(rows[0]) for row in rows):
        raise ContractError(f"user signal: {name}(t) returns one value at some times and three at others")
    if rows and len(rows[0]) == 3:
        position, velocity, acceleration = np.array(rows).T
        return position, velocity, acceleration
    slopes = np.array([_derivatives(function, time, name) for time in t.tolist()]).reshape(-1, 2)
    return np.array(rows).reshape(-1), slopes[:, 0], slopes[:, 1]


def _derivatives(function: Callable[[float], Any], t: float, name: str) -> tuple[float, float]:
    first = t - 2.0 * _STEP
    if first < 0.0 <= t:
        first = 0.0
    values = [_answer(function, first + i * _STEP, name)[0] for i in range(5)]
    polynomial = _TO_POLYNOMIAL @ values
    s = (t - first) / _STEP
    velocity = (_POWERS[1:] * s ** _POWERS[:-1]) @ polynomial[1:] / _STEP
    acceleration = (_POWERS[2:] * _POWERS[1:-1] * s ** _POWERS[:-2]) @ polynomial[2:] / _STEP**2
    return float(velocity), float(acceleration)


def _answer(function: Callable[[float], Any], t: float, name: str) -> tuple[float, ...]:
    try:
        answer = function(t)
    except Exception as error:
        raise ContractError(f"user signal: {name}(t) fails at t = {t:g} s: {student_error(error)}") from error
    try:
        numbers = tuple(np.asarray(answer, dtype=float).ravel().tolist())
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) not in (1, 3) or not all(map(isfinite, numbers)):
        raise ContractError(
            f"user signal: {name}(t) returned {answer!r:.100} at t = {t:g} s; it must return one finite number, "
            f"or position, velocity and acceleration"
        )
    return numbers
