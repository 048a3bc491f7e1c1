"""Simulations compiled with numba, for sweeps and fits: the same functions as the loop's, in machine code.

Only a linear axis under a library law (or a voltage signal) can be compiled; anything else runs in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from rds.core.types import Ending
from rds.modes.host import Rows
from rds.runtime.plan import AxisPlan, Plan


def obstacle(plan: Plan) -> str | None:
    """Why the plan can't be compiled, in a sentence; None if it can."""
    try:
        import_module("numba")
    except ImportError:
        return "numba is not installed (pip install 'rds[fast]')"
    if plan.mode != "simulation":
        return f"{plan.mode} runs in real time; only simulations can be compiled"
    for axis in plan.axes:
        name = axis.axis.name
        if axis.model.source.name != "linear-axis" or axis.model.motion is None:
            return f"axis {name}: only the library's linear-axis model can be compiled"
        if axis.controller is not None and _law(axis) is None:
            return f"axis {name}: only the library's controllers can be compiled"
    return None


def run_compiled(plan: Plan) -> Rows:
    """What the loop would have recorded of a simulation, to the last bit. See `obstacle` for what can be compiled."""
    columns, units = plan.columns(None)
    rows = np.zeros((plan.samples, len(columns)))
    rows[:, 0] = np.arange(plan.samples)
    board = plan.machine.converter
    step = 2.0 * board.range / 2**board.bits if plan.quantization else 0.0
    if plan.saturation:
        low, high = -board.range, board.range - step
    else:
        low, high = -np.inf, np.inf
    of = {name: i for i, name in enumerate(columns)}
    for axis in plan.axes:
        name = axis.axis.name
        resolution = axis.axis.resolution if plan.quantization else 0.0
        constants = _constants(axis, plan.T)
        start = tuple(float(value) for value in axis.model.initial_state)
        measured, command, voltage = (np.empty(plan.samples) for _ in range(3))
        if axis.controller is None:
            command[:] = np.asarray(axis.signal, dtype=float)
            playing()(command, constants, start, step, low, high, resolution, measured, voltage)
        else:
            assert axis.reference is not None
            parts = [np.array(part) for part in _parts(axis)]
            for part, values in zip(("reference", "reference_velocity", "reference_acceleration"), parts, strict=True):
                rows[:, of[f"{name}_{part}"]] = values
            law, state = _law(axis), tuple(float(value) for value in axis.controller.initial_state)
            assert law is not None
            coefficients = tuple(axis.controller.params["coefficients"])
            tracking = controlled(law)
            tracking(
                *parts, coefficients, state, constants, start, step, low, high, resolution, measured, command, voltage
            )
        for part, values in (("measured", measured), ("command", command), ("voltage", voltage)):
            rows[:, of[f"{name}_{part}"]] = values
    return Rows(columns, units, rows, Ending.DONE, "", {})


@lru_cache
def controlled(law: Callable[..., Any]) -> Callable[..., None]:
    """The compiled loop of one axis under `law`, filling the arrays `measured`, `command` and `voltage`."""
    from numba import njit

    from rds.models.linear_axis import respond

    law, respond = njit(law), njit(respond)

    @njit
    def simulate(
        p, v, a, coefficients, state, constants, start, step, low, high, resolution, measured, command, voltage
    ):
        x, w = start
        T, decay, reach, tau, K, plus, minus = constants
        for k in range(len(p)):
            y = round(x / resolution) * resolution if resolution > 0.0 else x
            u, state = law(p[k], v[k], a[k], y, state, coefficients)
            measured[k] = y
            command[k] = u
            u = min(max(u, low), high)
            if step > 0.0:
                u = round(u / step) * step
            voltage[k] = u
            x, w = respond(x, w, u, T, decay, reach, tau, K, plus, minus)

    compiled: Callable[..., None] = simulate
    return compiled


@lru_cache
def playing() -> Callable[..., None]:
    """The compiled loop of one axis under a voltage signal, filling the arrays `measured` and `voltage`."""
    from numba import njit

    from rds.models.linear_axis import respond

    respond = njit(respond)

    @njit
    def simulate(command, constants, start, step, low, high, resolution, measured, voltage):
        x, w = start
        T, decay, reach, tau, K, plus, minus = constants
        for k in range(len(command)):
            measured[k] = round(x / resolution) * resolution if resolution > 0.0 else x
            u = min(max(command[k], low), high)
            if step > 0.0:
                u = round(u / step) * step
            voltage[k] = u
            x, w = respond(x, w, u, T, decay, reach, tau, K, plus, minus)

    compiled: Callable[..., None] = simulate
    return compiled


def _law(axis: AxisPlan) -> Callable[..., Any] | None:
    """The pure function behind a library controller."""
    assert axis.controller is not None
    control = axis.controller.control
    module = getattr(control, "__module__", "")
    if not module.startswith("rds.controllers.") or axis.controller.coupled:
        return None
    return getattr(import_module(module), "law", None)


def _constants(axis: AxisPlan, T: float) -> tuple[float, ...]:
    from rds.models.linear_axis import coefficients

    return coefficients(axis.model.params, T)


def _parts(axis: AxisPlan) -> tuple[Any, Any, Any]:
    reference = axis.reference
    assert reference is not None
    return reference.position, reference.velocity, reference.acceleration
