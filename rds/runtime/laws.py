"""What turns a measured position into a voltage at each sample: a controller, or a voltage signal played back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rds.core.errors import ContractError
from rds.core.types import Controller, Reference
from rds.interface import as_voltage
from rds.runtime.loop import Law


@dataclass(frozen=True)
class ReferenceSamples:
    """The reference of one axis at every sample: arrays in mm, mm/s, mm/s²."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class BrokenContract(ContractError):
    """The controller of an axis broke its contract during a run, at sample `k`."""


def controlled(
    axis: int, name: str, controller: Controller, reference: ReferenceSamples, T: float, limit: Callable[[Any], float]
) -> Law:
    """One axis under its own controller; records reference, measured position and command voltage."""
    control, params = controller.control, dict(controller.params)
    state = controller.initial_state
    columns = (reference.position, reference.velocity, reference.acceleration)
    p, v, a = (column.tolist() for column in columns)  # plain floats are several times faster one by one
    make = Reference._make

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        nonlocal state
        r = make((p[k], v[k], a[k]))
        y = positions[axis]
        answer = control(k * T, r, y, state, params)
        try:
            u, state = answer
            if type(u) is not float:
                u = as_voltage(u)
            voltages.append(limit(u))
        except (TypeError, ValueError, OverflowError, ContractError):
            raise BrokenContract(_fault(answer, k * T, name), controller.source.path) from None
        row += r
        row += (y, u)

    return law


def coupled(
    axes: Sequence[int],
    names: Sequence[str],
    controller: Controller,
    references: Sequence[ReferenceSamples],
    T: float,
    limits: Sequence[Callable[[Any], float]],
) -> Law:
    """Several axes under one controller that gets and gives arrays in axis order."""
    control, params = controller.control, dict(controller.params)
    state = controller.initial_state
    n = len(axes)
    tables = [np.array([getattr(r, part) for r in references]).T for part in Reference._fields]

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        nonlocal state
        r = Reference(*(table[k] for table in tables))
        y = np.array([positions[axis] for axis in axes])
        answer = control(k * T, r, y.copy(), state, params)
        try:
            u, state = answer
            commands = np.asarray(u, dtype=float).reshape(n).tolist()
            voltages += [limit(value) for limit, value in zip(limits, commands, strict=True)]
        except (TypeError, ValueError, OverflowError, ContractError):
            raise BrokenContract(_fault(answer, k * T, ", ".join(names), n), controller.source.path) from None
        for i in range(n):
            row += (*(float(table[k, i]) for table in tables), float(y[i]), commands[i])

    return law


def played(axis: int, signal: Sequence[float], limit: Callable[[Any], float]) -> Law:
    """A voltage signal without a controller; records measured position and command voltage."""

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        u = signal[k]
        voltages.append(limit(u))
        row += (positions[axis], u)

    return law


def _fault(answer: Any, t: float, axis: str, n: int = 1) -> str:
    wanted = "one finite number in V" if n == 1 else f"{n} finite numbers in V, one for each axis"
    if not isinstance(answer, tuple | list) or len(answer) != 2:
        shown = f"control() returned {answer!r:.200} at t = {t:.3f} s (axis {axis})"
        return f"{shown}; it must return (voltage, next_state) with a finite voltage in V"
    return (
        f"control() returned the voltage {answer[0]!r:.200} at t = {t:.3f} s (axis {axis}); "
        f"it must return (voltage, next_state) with the voltage {wanted}"
    )
