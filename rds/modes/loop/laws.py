"""What turns a measured position into a command at each sample: a controller, or a voltage signal played back.

The command is a voltage, unless a drive closes a loop of its own: `VOLTAGE`, and what the others are called and
measured in, is for the sentences that refuse an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from rds.core.errors import ContractError
from rds.core.signals import EXAMPLE, return_line, signal_values, signals_wanted
from rds.core.types import Controller, Reference
from rds.core.values import is_masked, own_copy, shown
from rds.machines.converter import as_voltage
from rds.modes.loop.loop import Law

VOLTAGE = ("voltage", "V")  # a command, and its unit


@dataclass(frozen=True)
class ReferenceSamples:
    """The reference of one axis at every sample: arrays in mm, mm/s, mm/s²."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray

    def columns(self) -> tuple[Sequence[float], Sequence[float], Sequence[float]]:
        """Position, velocity and acceleration by sample: plain floats are several times faster one by one."""
        return self.position.tolist(), self.velocity.tolist(), self.acceleration.tolist()


class CurrentValue(Sequence[float]):
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
        self.position, self.velocity, self.acceleration = CurrentValue(position), CurrentValue(), CurrentValue()

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
    command: tuple[str, str] = VOLTAGE,
    states: list[Callable[[], Any]] | None = None,
) -> Law:
    """One axis under its own controller; records reference, measured position, command and its signals.

    `params` are the controller's, in a table that may be changed while it runs. A function that gives the controller's
    state of now is added to `states`.
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
            raise broken(answer, k * T, name, controller, command) from None
        row += r
        row += (y, u)

    if controller.signals:
        return _telling(axis, name, controller, reference, T, limit, params, command, states)
    if states is not None:
        states.append(lambda: state)
    return law


def _telling(
    axis: int,
    name: str,
    controller: Controller,
    reference: ReferenceSamples | LiveReference,
    T: float,
    limit: Callable[[Any], float],
    params: dict[str, Any],
    command: tuple[str, str],
    states: list[Callable[[], Any]] | None,
) -> Law:
    """`controlled` for a controller with signals: apart, so that one without pays nothing for them."""
    control, observe = controller.control, controller.observe
    names = tuple(controller.signals)
    state = _first_state(controller)
    p, v, a = reference.columns()
    make = Reference._make

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        nonlocal state
        r = make((p[k], v[k], a[k]))
        y = positions[axis]
        answer = control(k * T, r, y, state, params)
        try:
            if observe is None:
                u, following, told = answer if type(answer) is tuple else _pair(answer)
            else:
                u, following = answer
            if type(u) is not float:
                u = as_voltage(u)
            voltages.append(limit(u))
        except (TypeError, ValueError, OverflowError, ContractError):
            raise broken(answer, k * T, name, controller, command) from None
        if observe is None:
            values: Sequence[float] = told_values(told, names, k * T, name, controller)
        else:
            values = observe(y, state, following, params)
            for value in values:
                if not isfinite(value):
                    told_values(dict(zip(names, values, strict=True)), names, k * T, name, controller)
        state = following
        row += r
        row += (y, u, *values)

    if states is not None:
        states.append(lambda: state)
    return law


def coupled(
    axes: Sequence[int],
    names: Sequence[str],
    controller: Controller,
    references: Sequence[ReferenceSamples | LiveReference],
    T: float,
    limits: Sequence[Callable[[Any], float]],
    params: dict[str, Any],
    command: tuple[str, str] = VOLTAGE,
    states: list[Callable[[], Any]] | None = None,
) -> Law:
    """Several axes under one controller that gets and gives arrays in axis order; the rest as of `controlled`."""
    control, signals = controller.control, tuple(controller.signals)
    state = _first_state(controller)
    n, owners = len(axes), ", ".join(names)
    # for each part of a reference, one column per axis
    parts = list(zip(*(reference.columns() for reference in references), strict=True))

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        nonlocal state
        values = [[column[k] for column in columns] for columns in parts]
        r = Reference(*map(np.array, values))  # type: ignore[arg-type]
        y = np.array([positions[axis] for axis in axes])
        answer = control(k * T, r, y.copy(), state, params)
        try:
            u, state, *rest = _pair(answer)
            if len(rest) != (1 if signals else 0):
                raise TypeError
            commands = _commands(u, n)
            voltages += [limit(value) for limit, value in zip(limits, commands, strict=True)]
        except (TypeError, ValueError, OverflowError, ContractError):
            raise broken(answer, k * T, owners, controller, command, n) from None
        told = told_values(rest[0], signals, k * T, owners, controller, n) if signals else ()
        for i in range(n):
            row += (*(of_axes[i] for of_axes in values), float(y[i]), commands[i], *(value[i] for value in told))

    if states is not None:
        states.append(lambda: state)
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
    if is_masked(u):
        raise TypeError
    array = np.asarray(u)
    if array.dtype.kind not in "fiu":
        raise TypeError
    values: list[float] = array.astype(float).reshape(n).tolist()
    return values


def told_values(told: Any, names: Sequence[str], t: float, axis: str, controller: Controller, n: int = 0) -> list[Any]:
    """The values of the signals, in order; for a coupled law of `n` axes a list of each."""
    try:
        return signal_values(told, names, n)
    except ValueError as error:
        said = f"control() returned signals at t = {t:.3f} s (axis {axis}) that will not do: {error}"
        raise BrokenContract(f"{said}; {signals_wanted(names, n)}", _line(controller)) from None


def broken(
    answer: Any, t: float, axis: str, controller: Controller, command: tuple[str, str], n: int = 1
) -> BrokenContract:
    """The error of a command that is none, or of an answer that has too few or too many parts."""
    names, is_several = tuple(controller.signals), isinstance(answer, tuple | list)
    said = f"control() returned {shown(answer, 200)} at t = {t:.3f} s (axis {axis})"
    if names and controller.observe is None and not (is_several and len(answer) == 3):
        wanted = signals_wanted(names, n if controller.coupled else 0, command[0])
        return BrokenContract(f"{said}; as signals declares {', '.join(names)}, {wanted}", _line(controller))
    if not names and is_several and len(answer) == 3 and isinstance(answer[2], Mapping):
        wanted = f"it must return ({command[0]}, next_state), unless the file declares the third part beside params"
        return BrokenContract(f"{said}; {wanted}, as in {EXAMPLE}", _line(controller))
    parts = 3 if names and controller.observe is None else 2
    return BrokenContract(_fault(answer, t, axis, parts, command, n), controller.source.path)


def _line(controller: Controller) -> str | None:
    """The student's file, and the line of the answer where that can be said."""
    path = controller.source.path
    line = return_line(controller.control, path)
    return path if line is None else f"{path}:{line}"


def _fault(answer: Any, t: float, axis: str, parts: int, command: tuple[str, str], n: int) -> str:
    what, unit = command
    wanted = f"one finite number in {unit}" if n == 1 else f"{n} finite numbers in {unit}, one for each axis"
    if not isinstance(answer, tuple | list) or len(answer) != parts:
        said = f"control() returned {shown(answer, 200)} at t = {t:.3f} s (axis {axis})"
        return f"{said}; it must return ({what}, next_state) with a finite {what} in {unit}"
    return (
        f"control() returned the {what} {shown(answer[0], 200)} at t = {t:.3f} s (axis {axis}); "
        f"it must return ({what}, next_state) with the {what} {wanted}"
    )
