"""Simulations compiled with numba, for sweeps and fits: the same functions as the loop's, in machine code.

Only a linear axis under a library law (or a voltage signal) can be compiled; anything else runs in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from importlib import import_module
from math import inf
from typing import Any

import numpy as np

from rds.core.extras import remedy
from rds.core.types import Ending
from rds.machines import converter
from rds.machines.converter import limits
from rds.models.linear_axis import LinearAxisMotion, coefficients, respond
from rds.modes import load_mode
from rds.modes.loop.commands import Command
from rds.modes.loop.plan import AxisPlan, Plan
from rds.modes.process.host import Rows


def obstacle(plan: Plan) -> str | None:
    """Why the plan can't be compiled, in a sentence; None if it can."""
    try:
        import_module("numba")
    except ImportError:
        return f"numba is not installed; install it with: {remedy('fast')}"
    if plan.program is not None:
        return "a path or a part program drives the axes"
    if plan.network is not None:
        return "a network is between the axes and their controllers"
    if plan.changes:
        return "live values change while it runs"
    if load_mode(plan.mode).real_time:
        return f"{plan.mode} runs in real time; only simulations can be compiled"
    for axis in plan.axes:
        name = axis.axis.name
        if axis.following_error is not None:
            return f"axis {name}: its following error is watched, which may end the run"
        if axis.command is not Command.VOLTAGE:
            return f"axis {name}: its drive closes a loop of its own"
        if axis.model.motion is not LinearAxisMotion:
            return f"axis {name}: only the library's linear-axis model can be compiled"
        if axis.controller is not None and pure_law(axis) is None:
            return f"axis {name}: only the library's controllers can be compiled"
        if axis.signals and pure_law(axis, "known") is None:
            return f"axis {name}: the signals of this controller cannot be compiled"
    return None


def run_compiled(plan: Plan) -> Rows | None:
    """What the loop would have recorded of a simulation, to the last bit. See `obstacle` for what can be compiled.

    None where a position or a voltage grows beyond all numbers: the loop says which, and when.
    """
    columns, units = plan.columns(None, simulates_plant=True)
    rows = np.empty((plan.samples, len(columns)))
    rows[:, 0] = np.arange(plan.samples)
    board = plan.machine.converter
    output = limits(board.range, board.bits, saturation=plan.saturation, quantization=plan.quantization)
    for axis in plan.axes:
        name = axis.axis.name
        resolution = axis.axis.resolution if plan.quantization else 0.0
        far = resolution * 2.0**62 if resolution else inf  # to where positions can be counted
        start = tuple(float(value) for value in axis.model.initial_state)
        voltage = rows[:, columns.index(f"{name}_voltage")]
        first = columns.index(f"{name}_reference" if axis.controller else f"{name}_measured")
        table = rows[:, first : columns.index(f"{name}_command") + 1 + len(axis.signals)]
        interface = (*output, resolution, far)
        constants = coefficients(axis.model.params, plan.T)
        if axis.controller is None:
            taken = playing()(np.asarray(axis.signal, dtype=float), constants, start, interface, table, voltage)
        else:
            reference, law = axis.reference, pure_law(axis)
            assert reference is not None and law is not None
            parts = (reference.position, reference.velocity, reference.acceleration)
            tracking = controlled(law, pure_law(axis, "known") if axis.signals else None)
            plant = f"{name}_plant_velocity"
            velocity = rows[:, columns.index(plant)] if plant in columns else np.empty(plan.samples)
            taken = tracking(
                *(np.asarray(part, dtype=float) for part in parts),
                tuple(axis.controller.params["coefficients"]),
                tuple(float(value) for value in axis.controller.initial_state),
                constants,
                start,
                interface,
                table,
                voltage,
                velocity,
            )
        if taken < plan.samples:
            return None
    return Rows(columns, units, rows, Ending.DONE, "", {})


@lru_cache
def controlled(law: Callable[..., Any], known: Callable[..., Any] | None) -> Callable[..., int]:
    """The compiled loop of one axis under `law`, filling its columns from the reference to the signals, and others.

    It returns how many samples it took: all, unless a position or a voltage grew beyond all numbers.
    The signals are those that `known` gives of a law that has them; the others are voltage and the plant's velocity.
    """
    from numba import njit

    law, move = njit(law), njit(respond)
    tell = _telling(known)
    counted, converted = converter.compiled()

    @njit
    def simulate(p, v, a, coefficients, state, constants, start, interface, table, voltage, velocity):  # type: ignore[no-untyped-def]
        x, w = start
        T, decay, reach, tau, K, plus, minus = constants
        low, high, step, resolution, far = interface
        for k in range(len(p)):
            if not abs(x) < far:
                return k
            y = counted(x, resolution)
            u, following = law(p[k], v[k], a[k], y, state, coefficients)
            if not abs(u) < inf:
                return k
            tell(table, k, y, state, following, coefficients)
            state = following
            velocity[k] = w
            table[k, 0] = p[k]
            table[k, 1] = v[k]
            table[k, 2] = a[k]
            table[k, 3] = y
            table[k, 4] = u
            u = converted(u, low, high, step)
            voltage[k] = u
            x, w = move(x, w, u, T, decay, reach, tau, K, plus, minus)
        return len(p)

    compiled: Callable[..., int] = simulate
    return compiled


def _telling(known: Callable[..., Any] | None) -> Callable[..., None]:
    """What writes the signals behind the command, compiled; nothing for a law that has none."""
    from numba import njit

    if known is None:

        @njit
        def nothing(table, k, y, state, following, coefficients):  # type: ignore[no-untyped-def]
            return None

        compiled: Callable[..., None] = nothing
        return compiled
    known = njit(known)

    @njit
    def tell(table, k, y, state, following, coefficients):  # type: ignore[no-untyped-def]
        values = known(y, state, following, coefficients)
        for i in range(len(values)):
            table[k, 5 + i] = values[i]

    compiled = tell
    return compiled


@lru_cache
def playing() -> Callable[..., int]:
    """The same under a voltage signal, filling the columns measured and command, and voltage."""
    from numba import njit

    move = njit(respond)
    counted, converted = converter.compiled()

    @njit
    def simulate(command, constants, start, interface, table, voltage):  # type: ignore[no-untyped-def]
        x, w = start
        T, decay, reach, tau, K, plus, minus = constants
        low, high, step, resolution, far = interface
        for k in range(len(command)):
            if not abs(x) < far:
                return k
            table[k, 0] = counted(x, resolution)
            table[k, 1] = command[k]
            u = converted(command[k], low, high, step)
            voltage[k] = u
            x, w = move(x, w, u, T, decay, reach, tau, K, plus, minus)
        return len(command)

    compiled: Callable[..., int] = simulate
    return compiled


def pure_law(axis: AxisPlan, name: str = "law") -> Callable[..., Any] | None:
    """The pure function behind a library controller; with "known" that of its signals."""
    assert axis.controller is not None
    control = axis.controller.control
    module = getattr(control, "__module__", "")
    if not module.startswith("rds.controllers.") or axis.controller.coupled:
        return None
    return getattr(import_module(module), name, None)
