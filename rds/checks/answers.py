"""What a controller's answer must be: a voltage, or one for each axis, the next state, and the signals it declares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from rds.checks import clauses
from rds.checks.values import is_real
from rds.core.signals import EXAMPLE, signal_values, signals_wanted
from rds.core.values import is_masked, shown


def voltage_fault(answer: Any, axes: int = 0, signals: Sequence[str] = ()) -> tuple[str, str, str] | None:
    """Clause, what was returned, remedy, if `answer` is no (voltage, next_state), or lacks declared `signals`.

    `axes` > 0 for a coupled law.
    """
    is_several = isinstance(answer, tuple | list)
    if signals and is_several and len(answer) == 2:
        said = f"{shown(answer)}, without the signals {', '.join(signals)}"
        return clauses.SIGNALS, said, f"{signals_wanted(signals, axes)}, or take `signals` out of the file"
    if not is_several or len(answer) != (3 if signals else 2):
        return clauses.PAIR, *_no_pair(answer)
    fault = _masked_fault(answer[0]) or (_array_fault(answer[0], axes) if axes else _number_fault(answer[0]))
    return fault or (_signals_fault(answer[2], axes, signals) if signals else None)


def _signals_fault(told: Any, axes: int, signals: Sequence[str]) -> tuple[str, str, str] | None:
    try:
        signal_values(told, signals, axes)
    except ValueError as error:
        return clauses.SIGNALS, f"signals that will not do: {error}", signals_wanted(signals, axes)
    return None


def _no_pair(answer: Any) -> tuple[str, str]:
    if answer is None:
        return "nothing", "end it with `return voltage, next_state`"
    if is_real(answer):
        return (
            f"{shown(answer)} alone",
            "end it with `return voltage, next_state`; without memory, return `state` itself",
        )
    if hasattr(answer, "__next__"):
        return "a generator", "use `return voltage, next_state`, not `yield`"
    if hasattr(answer, "__await__"):
        return "a coroutine", "write `def`, not `async def`"
    if isinstance(answer, tuple | list):
        remedy = "return two: the voltage, and all of the state as one value, as in `return u, [a, b]`"
        if len(answer) == 3 and isinstance(answer[2], Mapping):
            remedy = f"declare the signals beside params, as in {EXAMPLE}"
        return f"{len(answer)} values, {shown(answer)},", remedy
    return shown(answer), "end it with `return voltage, next_state`"


def _masked_fault(u: Any) -> tuple[str, str, str] | None:
    if is_masked(u):
        return clauses.VOLTAGE, f"the voltage {shown(u)}", "a masked number is none: fill it, or use plain arrays"
    return None


def _number_fault(u: Any) -> tuple[str, str, str] | None:
    if isinstance(u, np.ndarray) and u.size == 1 and u.dtype.kind in "fiu":  # as runs take it
        u = u.item()
    if is_real(u):
        try:
            if isfinite(u):
                return None
        except OverflowError:  # a whole number of hundreds of digits
            return clauses.VOLTAGE, f"the voltage {shown(u)}", "return a number that is not above 1e308 V"
        return clauses.VOLTAGE, f"the voltage {u}", "look for a division by zero, a root or a logarithm"
    said = f"the voltage {shown(u)} ({type(u).__name__})"
    if isinstance(u, np.ndarray | list | tuple | dict):
        return clauses.VOLTAGE, said, "return one number in V first and the state second: `return voltage, next_state`"
    return clauses.VOLTAGE, said, "return one real number in V"


def _array_fault(u: Any, axes: int) -> tuple[str, str, str] | None:
    said = f"the voltage {shown(u)}"
    remedy = f"a coupled controller returns an array of {axes} numbers in V, one for each axis"
    try:
        array = np.asarray(u)
    except ValueError:  # parts of different lengths
        return clauses.VOLTAGE, said, remedy
    if array.shape != (axes,) or array.dtype.kind not in "fiu":
        return clauses.VOLTAGE, said, remedy
    if not np.isfinite(array).all():
        return clauses.VOLTAGE, said, "look for a division by zero, a root or a logarithm"
    return None
