"""python-control systems as models and controllers: `StateSpace`, `TransferFunction`, `nlsys` and interconnections.

python-control is not imported here: who hands in such an object has imported it already.

Timebase: a discrete system's dt must be the sample period, or True for any. A continuous linear controller is
discretized by Tustin's rule, a continuous linear model exactly for a held voltage; a continuous nonlinear system is
integrated by RK4 with its input held.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import chain
from math import isclose, nan
from typing import Any

import numpy as np

from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import ContractError, InputError
from rds.core.integrate import rk4
from rds.core.timed_motion import TimedMotion
from rds.core.types import Controller, Model, Reference, Source
from rds.core.values import shown

_SAME = 1e-9
Rows = tuple[tuple[float, ...], ...]


def is_control_system(obj: Any) -> bool:
    """Whether `obj` is a system of python-control, or of a class derived from one."""
    return any(kind.__module__.startswith("control.") for kind in type(obj).__mro__) and hasattr(obj, "ninputs")


def as_controller(obj: Any, T: float) -> Controller:
    """A python-control system as a controller sampled every `T` s; a `Controller` comes back as it is.

    One output, the voltage (V); and 1 input, the error r - y; or 2, r.position and y; or 4, r.position, r.velocity,
    r.acceleration and y (as `rds.controllers.design.tracking_controller_system`). It starts from the zero state; a
    linear one to which every place is alike, such as one with an observer, counts positions from the first measured.
    Raises InputError for other sizes, another sample period or another kind of object.
    """
    if isinstance(obj, Controller):
        return obj
    sys = _system(obj, "controller")
    if sys.ninputs not in (1, 2, 4) or sys.noutputs != 1:
        raise InputError(
            f"controller {_name(sys)}: {_sizes(sys)}; it needs 1 output (voltage) and 1 input (the error r - y), "
            f"2 (r.position, y) or 4 (r.position, r.velocity, r.acceleration, y)"
        )
    continuous = _is_continuous(sys, T, "controller")
    state = (0.0,) * (sys.nstates or 0)
    if _is_linear(sys):
        params = _matrices(sys.sample(T, method="bilinear") if continuous and state else sys)
        if state and _is_alike_everywhere(params):
            return Controller(_control_from_origin, (nan, *state), params, Source(_name(sys)))
        return Controller(_linear_control, state, params, Source(_name(sys)))
    step = partial(_nonlinear_control, sys=sys, T=T, continuous=continuous)
    return Controller(step, state, dict(sys.params), Source(_name(sys)))


def as_model(obj: Any, T: float) -> Model:
    """A python-control system as an axis model sampled every `T` s; a `Model` comes back as it is.

    One input, the voltage (V); its first output is what the encoder sees (mm; rev/min for a spindle). It starts from
    the zero state. Raises InputError for other sizes, another sample period, another kind of object, or an output
    that jumps with the voltage: the encoder reads before the voltage of a sample is known.
    """
    if isinstance(obj, Model):
        return obj
    sys = _system(obj, "model")
    if sys.ninputs != 1 or not sys.noutputs or not sys.nstates:
        raise InputError(
            f"model {_name(sys)}: {_sizes(sys)}; it needs 1 input (voltage), at least 1 output (the first is the "
            f"position) and at least 1 state"
        )
    continuous = _is_continuous(sys, T, "model")
    state = (0.0,) * sys.nstates
    if _is_linear(sys):
        params = _matrices(sys.sample(T, method="zoh") if continuous else sys)
        _check_no_jump(sys, params["D"][0][0] != 0.0)
        output = partial(_dot, params["C"][0])
        flow = np.hstack([np.asarray(sys.A, dtype=float), np.asarray(sys.B, dtype=float)]) if continuous else None
        return Model(partial(_linear_advance, period=T, flow=flow), state, params, output, Source(_name(sys)))
    reads = partial(_nonlinear_output, sys=sys)
    try:
        jumps = reads(state) != reads(state, voltage=1.0)
    except STUDENT_ERRORS as error:
        raise ContractError(f"model {_name(sys)}: its output function fails: {student_error(error)}") from error
    _check_no_jump(sys, jumps)
    advance = partial(_nonlinear_advance, sys=sys, period=T, continuous=continuous)
    return Model(advance, state, dict(sys.params), reads, Source(_name(sys)), motion=TimedMotion, timed=True)


def _system(obj: Any, role: str) -> Any:
    """The system, a transfer function as the state space that realizes it."""
    if not is_control_system(obj):
        raise InputError(
            f"{role}: {obj!r:.100} is no {role.capitalize()} and no python-control system; hand in a file, a function, "
            f"a library name, or a control.StateSpace or control.nlsys object"
        )
    if hasattr(obj, "num") and hasattr(obj, "den"):
        fractions = zip(chain.from_iterable(obj.num), chain.from_iterable(obj.den), strict=True)
        if any(_degree(num) > _degree(den) for num, den in fractions):
            raise InputError(
                f"{role}: the numerator of {_name(obj)} has a higher degree than its denominator: it answers what "
                "has not come yet; give it fast poles as well, such as control.tf([Kd, Kp], [0.002, 1]) in place of "
                "control.tf([Kd, Kp], [1])"
            )
        try:
            from control import ss

            return ss(obj)
        except Exception as error:  # python-control has many, and some are slycot's
            raise InputError(f"{role}: {_name(obj)} has no state space: {error}; use control.ss") from error
    if not _is_linear(obj) and not hasattr(obj, "dynamics"):
        raise InputError(f"{role}: a {type(obj).__name__} cannot be run; use control.StateSpace or control.nlsys")
    return obj


def _degree(coefficients: np.ndarray) -> int:
    return len(np.trim_zeros(np.atleast_1d(coefficients), "f")) - 1


def _is_linear(sys: Any) -> bool:
    return all(hasattr(sys, name) for name in ("A", "B", "C", "D"))


def _is_continuous(sys: Any, T: float, role: str) -> bool:
    dt = sys.dt
    if dt is True or (dt is None and not sys.nstates):
        return False
    if dt is None:
        raise InputError(
            f"{role} {_name(sys)} has no timebase (dt = None); give dt = 0 if it is continuous, dt = {T:g} if discrete"
        )
    if dt == 0:
        return True
    if not isclose(dt, T, rel_tol=1e-9):
        raise InputError(
            f"{role} {_name(sys)} is discrete with dt = {dt:g} s, but the sample period is {T:g} s; "
            f"make it for {T:g} s, or set sample_period = {dt:g}"
        )
    return False


def _check_no_jump(sys: Any, jumps: bool) -> None:
    if jumps:
        raise InputError(
            f"model {_name(sys)}: its first output jumps with the voltage (D is not 0); "
            f"the output must be a position, which follows from the state alone"
        )


def _name(sys: Any) -> str:
    return str(getattr(sys, "name", None) or type(sys).__name__)


def _sizes(sys: Any) -> str:
    parts = ((sys.ninputs, "input"), (sys.noutputs, "output"), (sys.nstates, "state"))
    return "it has " + ", ".join(f"{count or 0} {what}{'' if count == 1 else 's'}" for count, what in parts)


def _matrices(sys: Any) -> dict[str, Rows]:
    """A, B, C, D as rows of floats: for a few states plain Python is faster than arrays, and a record can hold them."""
    return {name: tuple(map(tuple, np.asarray(getattr(sys, name), dtype=float).tolist())) for name in "ABCD"}


def _dot(row: Sequence[float], x: Sequence[float]) -> float:
    return sum(a * b for a, b in zip(row, x, strict=True))


def _inputs(count: int, r: Reference, y: float) -> tuple[float, ...]:
    if count == 1:
        return (r[0] - y,)
    return (r[0], y) if count == 2 else (r[0], r[1], r[2], y)


def _linear_control(t: float, r: Reference, y: float, state: Sequence[float], params: Any) -> tuple[float, Any]:
    A, B, C, D = params["A"], params["B"], params["C"], params["D"]
    inputs = _inputs(len(D[0]), r, y)
    moved = tuple(_dot(a, state) + _dot(b, inputs) for a, b in zip(A, B, strict=True))
    return float(_dot(C[0], state) + _dot(D[0], inputs)), moved


def _is_alike_everywhere(params: Any) -> bool:
    """Whether a state at rest under zero volts belongs to every place: an observer's, and not that of a spring's force,
    unless an integrator could make up for it.
    """
    A, B, C, D = (np.array(params[name]) for name in "ABCD")
    place = {2: [1.0, 1.0], 4: [1.0, 0.0, 0.0, 1.0]}.get(D.shape[1])
    if place is None:  # of the error r - y
        return False
    left = np.vstack([np.eye(len(A)) - A, C])
    right = np.concatenate([B @ place, -D @ place])
    # in states and equations of like size: beside 1e12 V, whatever the last one asks for would count as rounding
    rows = np.hstack([left, np.vstack([B, D]) * place])
    left, right = left / _sizes_of(rows)[:, None], right / _sizes_of(rows)
    left = left / _sizes_of(left.T)
    state = np.linalg.lstsq(left, right, rcond=None)[0]
    return bool(np.abs(left @ state - right).max() <= _SAME * (np.abs(left) @ np.abs(state) + np.abs(right)).max())


def _sizes_of(rows: np.ndarray) -> np.ndarray:
    """The largest magnitude in each row; 1 for one of zeros."""
    largest = np.abs(rows).max(axis=1)
    return np.where(largest > 0.0, largest, 1.0)


def _control_from_origin(t: float, r: Reference, y: float, state: Sequence[float], params: Any) -> tuple[float, Any]:
    """As `_linear_control` for positions from the first measured one, the state's first number (NaN before it)."""
    origin, *own = state
    if origin != origin:
        origin = y
    u, moved = _linear_control(t, Reference(r[0] - origin, r[1], r[2]), y - origin, own, params)
    return u, (origin, *moved)


def _linear_advance(
    x: Sequence[float], u: float, T: float, params: Any, *, period: float, flow: np.ndarray | None
) -> tuple[float, ...]:
    """One sample; of a continuous system, whose `flow` is [A B], also any part of one, exactly."""
    if flow is not None and not isclose(T, period, rel_tol=1e-9):
        from scipy.linalg import expm  # a second that most runs can do without

        n = len(x)
        moving = expm(T * np.vstack([flow, np.zeros((1, n + 1))]))[:n]
        return tuple((moving @ [*x, u]).tolist())
    _check_period(T, period)
    return tuple(_dot(row, x) + b[0] * u for row, b in zip(params["A"], params["B"], strict=True))


def _nonlinear_control(
    t: float, r: Reference, y: float, state: Sequence[float], params: Any, *, sys: Any, T: float, continuous: bool
) -> tuple[float, Any]:
    x, inputs = np.array(state, dtype=float), np.array(_inputs(sys.ninputs, r, y))
    voltage = np.asarray(sys.output(t, x, inputs, params=params), dtype=float).ravel()
    return float(voltage[0]), _moved(sys, t, x, inputs, T, params, continuous)


def _nonlinear_advance(
    x: Sequence[float], u: float, T: float, params: Any, *, sys: Any, period: float, continuous: bool, t: float = 0.0
) -> tuple[float, ...]:
    if not continuous:
        _check_period(T, period)
    return _moved(sys, t, np.array(x, dtype=float), np.array(u, dtype=float).reshape(1), T, params, continuous)


def _moved(
    sys: Any, t: float, x: np.ndarray, u: np.ndarray, T: float, params: Any, continuous: bool
) -> tuple[float, ...]:
    def update(t: float, x: Any, u: np.ndarray, params: Any) -> list[float]:
        answer: list[float] = np.asarray(sys.dynamics(t, np.array(x), u, params=params), dtype=float).ravel().tolist()
        if len(answer) != len(x):
            said = f"the update function of {sys.name} returned {shown(answer)}, which is no change of its state"
            raise ContractError(f"{said}; it must return {len(x)} numbers, one for each state")
        return answer

    if x.size == 0:
        return ()
    return tuple(rk4(update, t, x.tolist(), u, T, params) if continuous else update(t, x, u, params))


def _nonlinear_output(
    x: Sequence[float], *, sys: Any, voltage: float = 0.0, t: float = 0.0, params: Any = None
) -> float:
    answer = sys.output(
        t, np.array(x, dtype=float), np.array([voltage]), params=sys.params if params is None else params
    )
    return float(np.asarray(answer, dtype=float).ravel()[0])


def _check_period(T: float, period: float) -> None:
    if not isclose(T, period, rel_tol=1e-9):
        raise InputError(
            f"this model was made for a sample period of {period:g} s, not {T:g} s; adapt it again for that"
        )
