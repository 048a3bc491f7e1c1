"""What turns a measured position into a voltage at each sample: a controller, or a voltage signal played back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rds.core.errors import ContractError
from rds.core.types import Controller, Reference
from rds.core.values import own_copy, shown
from rds.machines.converter import as_voltage
from rds.modes.loop.loop import Law


@dataclass(frozen=True)
class ReferenceSamples:
    """The reference of one axis at every sample: arrays in mm, mm/s, mm/s²."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    def columns(self) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
        """Position, velocity and acceleration by sample: plain floats are several times faster one by one."""
        return self.position.tolist(), self.velocity.tolist(), self.acceleration.tolist()


class Now(Sequence[float]):
    """A column whose value is made as the run goes on: whichever sample is asked for, it is the one of now."""

    __slots__ = ("value",)

    def __init__(self, value: float = 0.0):
        self.value = value

    def __getitem__(self, k: Any) -> Any:
        return self.value

    def __len__(self) -> int:
        return 1


class LiveReference:
    """The reference of one axis, made while it runs: what drives it sets the values of now before the laws ask."""

    def __init__(self, position: float = 0.0):
        self.position, self.velocity, self.acceleration = Now(position), Now(), Now()

    def columns(self) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
        """Position, velocity and acceleration of now."""
        return self.position, self.velocity, self.acceleration


class BrokenContract(ContractError):
    """The controller of an axis broke its contract during a run, at sample `k`."""


def controlled(
    axis: int,
    name: str,
    controller: Controller,
    reference: ReferenceSamples | LiveReference,
    T: float,
    limit: Callable[[Any], float],
    params: dict[str, Any],
) -> Law:
    """One axis under its own controller; records reference, measured position and command voltage.

    `params` are the controller's, in a table that may be changed while it runs.
    """
    control = controller.control
    state = _first_state(controller)
    p, v, a = reference.columns()
    make = Reference._make

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        nonlocal state
        r = make((p[k], v[k], a[k]))
        y = positions[axis]
        answer = control(k * T, r, y, state, params)
        try:
            u, state = answer if type(answer) is tuple else _pair(answer)
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
    references: Sequence[ReferenceSamples | LiveReference],
    T: float,
    limits: Sequence[Callable[[Any], float]],
    params: dict[str, Any],
) -> Law:
    """Several axes under one controller that gets and gives arrays in axis order; `params` as of `controlled`."""
    control = controller.control
    state = _first_state(controller)
    n = len(axes)
    # for each part of a reference, one column per axis
    parts = list(zip(*(reference.columns() for reference in references), strict=True))

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        nonlocal state
        values = [[column[k] for column in columns] for columns in parts]
        r = Reference(*map(np.array, values))  # type: ignore[arg-type]
        y = np.array([positions[axis] for axis in axes])
        answer = control(k * T, r, y.copy(), state, params)
        try:
            u, state = _pair(answer)
            commands = _commands(u, n)
            voltages += [limit(value) for limit, value in zip(limits, commands, strict=True)]
        except (TypeError, ValueError, OverflowError, ContractError):
            raise BrokenContract(_fault(answer, k * T, ", ".join(names), n), controller.source.path) from None
        for i in range(n):
            row += (*(of_axes[i] for of_axes in values), float(y[i]), commands[i])

    return law


def played(axis: int, signal: Sequence[float], limit: Callable[[Any], float]) -> Law:
    """A voltage signal without a controller; records measured position and command voltage."""

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        u = signal[k]
        voltages.append(limit(u))
        row += (positions[axis], u)

    return law


def _first_state(controller: Controller) -> Any:
    """A state of this run's own: one that is changed in place must not be the next run's, nor another axis's."""
    return own_copy(controller.initial_state, "initial_state", controller.source.path)


def _pair(answer: Any) -> Any:
    """The answer, if it has an order: a dict or a set would be unpacked into its keys. TypeError otherwise."""
    if not isinstance(answer, tuple | list):
        raise TypeError
    return answer


def _commands(u: Any, n: int) -> list[float]:
    """The `n` voltages of a coupled law, V; TypeError or ValueError for what is not that, such as texts."""
    array = np.asarray(u)
    if array.dtype.kind not in "fiu":
        raise TypeError
    values: list[float] = array.astype(float).reshape(n).tolist()
    return values


def _fault(answer: Any, t: float, axis: str, n: int = 1) -> str:
    wanted = "one finite number in V" if n == 1 else f"{n} finite numbers in V, one for each axis"
    if not isinstance(answer, tuple | list) or len(answer) != 2:
        said = f"control() returned {shown(answer, 200)} at t = {t:.3f} s (axis {axis})"
        return f"{said}; it must return (voltage, next_state) with a finite voltage in V"
    return (
        f"control() returned the voltage {shown(answer[0], 200)} at t = {t:.3f} s (axis {axis}); "
        f"it must return (voltage, next_state) with the voltage {wanted}"
    )
