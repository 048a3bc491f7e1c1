"""A student's own model: `derivatives` integrated by fixed-step Runge-Kutta, or an exact `advance`.

`derivatives(t, x, u, params)` is python-control's convention: x and u are 1-D arrays, the answer is dx/dt. Over one
sample the voltage is constant, and the classical fourth-order Runge-Kutta method takes `substeps` equal steps: no
step-size control, so every sample costs and errs the same, and a run repeats to the bit. A derivative that jumps, as
Coulomb friction's does, falls to first order in the sample of the jump: then write `advance` with the exact response.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from functools import partial
from typing import Any

import numpy as np

from rds.core.errors import ContractError, InputError
from rds.core.integrate import SUBSTEPS, rk4
from rds.core.timed_motion import TimedMotion
from rds.core.types import Model, Source
from rds.core.values import is_masked, is_table, shown

Function = Callable[..., Any]

_FLOAT64 = np.float64  # looked up once, for what is asked 40 times a sample


def ode_model(
    derivatives: Function,
    initial_state: Sequence[float] = (0.0, 0.0),
    params: Mapping[str, Any] | None = None,
    output: Function | None = None,
    substeps: int = SUBSTEPS,
    source: Source | None = None,
) -> Model:
    """A model from `derivatives(t, x, u, params) -> dx/dt` and, optionally, `output(t, x, u, params)`.

    x holds position (mm), velocity (mm/s) and whatever follows; u = [voltage] in V, and t is the time since the run
    began, s. Raises InputError for a bad initial state or number of substeps, and, while running, ContractError for
    derivatives of the wrong size or kind.
    """
    if isinstance(substeps, bool) or not isinstance(substeps, int) or substeps < 1:
        raise InputError(f"model: substeps = {substeps!r} must be a whole number of 1 or more")
    start = _initial_state(initial_state)
    own = dict(params or {})
    return Model(
        advance=partial(_advance_by_rk4, derivatives=derivatives, substeps=substeps, where=_place(source)),
        initial_state=start,
        params=own,
        output=_output(output, own, _place(source)),
        source=source or Source(_name(derivatives)),
        motion=TimedMotion,
        has_velocity=_has_velocity(start, output),
        timed=True,
    )


def advance_model(
    advance: Function,
    initial_state: Sequence[float] = (0.0, 0.0),
    params: Mapping[str, Any] | None = None,
    output: Function | None = None,
    source: Source | None = None,
) -> Model:
    """A model from a student's `advance(x, u, T, params) -> next x`, with x a 1-D array and u an array of one voltage.

    So `u` and `u[0]` both work, as they do in `derivatives`. Raises InputError for a bad initial state and, while
    running, ContractError for a state of the wrong size or kind.
    """
    start = _initial_state(initial_state)
    own = dict(params or {})
    return Model(
        advance=partial(_advance_by_student, function=advance, where=_place(source)),
        initial_state=start,
        params=own,
        output=_output(output, own, _place(source)),
        source=source or Source(_name(advance)),
        motion=TimedMotion if output is not None else None,
        has_velocity=_has_velocity(start, output),
        timed=output is not None,
    )


def _place(source: Source | None) -> str | None:
    return source.path if source else None


def _has_velocity(start: Sequence[float], output: Function | None) -> bool:
    """Without an `output`, the first states are position and velocity; with one they may be anything."""
    return output is None and len(start) >= 2


def _advance_by_rk4(
    x: Sequence[float],
    u: float,
    T: float,
    params: Mapping[str, Any],
    *,
    derivatives: Function,
    substeps: int,
    t: float = 0.0,
    where: str | None = None,
) -> tuple[float, ...]:
    slopes = partial(_slopes, derivatives, len(x), where)
    return tuple(rk4(slopes, t, list(map(float, x)), _voltage(u), T, params, substeps))


def _slopes(
    derivatives: Function, size: int, where: str | None, t: float, x: list[float], u: np.ndarray, params: Any
) -> list[float]:
    """dx/dt as numbers of its own: a function may give the same array, or list, each time that it is asked."""
    answer = derivatives(t, np.array(x), u, params)
    kind = type(answer)
    numbers = answer.tolist() if kind is np.ndarray and answer.ndim else answer if kind is list or kind is tuple else ()
    if len(numbers) == size:
        own = []
        for number in numbers:
            if type(number) is _FLOAT64:
                own.append(float(number))
            elif type(number) is float:
                own.append(number)
            else:
                break
        else:
            return own
    return _vector(answer, size, "derivatives", "dx/dt", where).tolist()


def _advance_by_student(
    x: Sequence[float],
    u: float,
    T: float,
    params: Mapping[str, Any],
    *,
    function: Function,
    t: float = 0.0,
    where: str | None = None,
) -> tuple[float, ...]:
    state = np.array(x, dtype=float)
    return tuple(_vector(function(state, _voltage(u), T, params), state.size, "advance", "the next x", where).tolist())


def _voltage(u: Any) -> np.ndarray:
    return np.array(u, dtype=float).reshape(1)


def _vector(answer: Any, size: int, function: str, meaning: str, where: str | None = None) -> np.ndarray:
    vector = _flat(answer)
    if vector.size != size:
        raise ContractError(
            f"{function}() returned {shown(answer, 200)}; it must return {meaning}, "
            f"{size} number{'s' if size != 1 else ''} as the initial state has",
            where,
        )
    return vector


def _flat(answer: Any) -> np.ndarray:
    """The answer as a flat array of floats; empty if it is none."""
    try:
        return _numbers(answer)
    except (TypeError, ValueError):
        pass
    try:
        if isinstance(answer, Set | Mapping):  # which have no order of their own
            raise TypeError
        # [x[1], (K*u - x[1])/tau] holds a number and an array of one, as u is one.
        return np.concatenate([_numbers(part) for part in answer])
    except (TypeError, ValueError):
        return np.empty(0)


def _numbers(answer: Any) -> np.ndarray:
    if is_masked(answer):
        raise TypeError
    array = np.asarray(answer)
    if array.dtype.kind not in "fiub":  # None, which numpy would take for NaN, text, complex numbers
        raise TypeError
    return array.astype(float, copy=False).ravel()


def _output(output: Function | None, own: Mapping[str, Any], where: str | None) -> Callable[..., float] | None:
    return None if output is None else partial(_output_by_student, function=output, own=own, where=where)


def _output_by_student(
    x: Sequence[float],
    *,
    function: Function,
    own: Mapping[str, Any],
    t: float = 0.0,
    params: Mapping[str, Any] | None = None,
    where: str | None = None,
) -> float:
    # The encoder reads before the voltage of this sample is known, so an output cannot depend on it.
    answer = function(t, np.array(x, dtype=float), np.zeros(1), own if params is None else params)
    values = _flat(answer)
    if values.size != 1:
        said = f"output() returned {shown(answer, 200)}; it must return the measured position, one number"
        raise ContractError(f"{said}, as in `return x[0]`", where)
    return float(values[0])


def _initial_state(values: Sequence[float]) -> tuple[float, ...]:
    state = _flat(values)
    if state.size == 0 or not np.isfinite(state).all():
        raise InputError(
            f"model: initial_state = {shown(values, 200)} must hold finite numbers, such as [0.0, 0.0] for "
            f"position and velocity"
        )
    if is_table(values):
        raise InputError(
            f"model: initial_state = {shown(values, 200)} is a table; write one list, {shown(state.tolist())}"
        )
    return tuple(state.tolist())


def _name(function: Function) -> str:
    return getattr(function, "__name__", type(function).__name__)
