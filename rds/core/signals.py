"""The signals that a controller gives beside the voltage: what it declares, and what it must then return."""

from __future__ import annotations

import dis
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from rds.core.values import is_masked, shown

MOST = 16  # signals of a controller: each is a column for each axis
LONGEST_NAME = 40  # characters
LONGEST_UNIT = 24
TAKEN = (
    "reference",
    "reference_velocity",
    "reference_acceleration",
    "measured",
    "command",
    "voltage",
    "target",
    "modelled",
    "simulated",
    "plant_velocity",
    "plant_current",
    "actual",
    "error",
)
"""How the names of other columns of an axis end: what reads a result finds them by these endings."""

EXAMPLE = '`signals = {"velocity": "mm/s"}`'


def declaration_fault(signals: Any) -> str | None:
    """What is wrong with `signals`, names with their units, and the remedy; None if nothing is."""
    if not isinstance(signals, Mapping):
        said = f"signals is {shown(signals)} ({type(signals).__name__})"
        return f"{said}; it must be a dict of names with their units, as in {EXAMPLE}"
    if len(signals) > MOST:
        return f"signals declares {len(signals)} signals; a controller may have {MOST}: record fewer"
    for name, unit in signals.items():
        if not isinstance(name, str) or not name.isidentifier() or len(name) > LONGEST_NAME:
            return (
                f"signals has the name {shown(name)}; it must be a word of letters, digits and underscores, of at most "
                f"{LONGEST_NAME} characters, as in {EXAMPLE}"
            )
        for ending in TAKEN:
            if name == ending or name.endswith(f"_{ending}"):
                other = f"X_{ending}"
                return f"signals has the name {name!r}; columns such as {other} end so: choose another name"
        if not isinstance(unit, str) or not unit.isprintable() or len(unit) > LONGEST_UNIT or set(unit) & set("[]"):
            return (
                f"signals gives {name!r} the unit {shown(unit)}; it must be text of at most {LONGEST_UNIT} characters, "
                f'as in {EXAMPLE}; "" stands for a pure number'
            )
    return None


def signal_values(told: Any, names: Sequence[str], axes: int = 0) -> list[Any]:
    """The values in `told`, the third of a controller's answer, in the order of `names`.

    Each is a float, or for a coupled law of `axes` axes a list of as many floats. ValueError says what is wrong.
    """
    if type(told) is dict and len(told) == len(names) and not axes:  # nearly always right, and then this is all
        values = [told.get(name) for name in names]
        for value in values:
            if type(value) is not float or not isfinite(value):
                break
        else:
            return values
    if not isinstance(told, Mapping):
        raise ValueError(f"the signals are {shown(told)}")
    if missing := [name for name in names if name not in told]:
        raise ValueError(f"the signals {shown(told)} lack {', '.join(map(repr, missing))}")
    if len(told) > len(names):
        others = ", ".join(shown(name) for name in told if name not in names)
        raise ValueError(f"the signals have {others}, which is not declared")
    return [_numbers(told[name], name, axes) for name in names]


def signals_wanted(names: Sequence[str], axes: int = 0, command: str = "voltage") -> str:
    """What a controller that declares signals must return, in words."""
    each = f"an array of {axes} finite numbers, one for each axis" if axes else "one finite number"
    return f"it must return ({command}, next_state, {{{', '.join(f'{name!r}: ...' for name in names)}}}), each {each}"


def return_line(function: Callable[..., Any], path: str | None) -> int | None:
    """The line of the `return` of a function in the file `path`, its first line if there are several; None if unknown.

    An answer that breaks the contract raises nothing where it is made: this is as near as one can say.
    """
    code = getattr(function, "__code__", None)
    if code is None or path is None or code.co_filename != path:
        return None
    lines = {at.positions.lineno for at in dis.get_instructions(code) if at.opname == "RETURN_VALUE" and at.positions}
    lines.discard(None)
    return lines.pop() if len(lines) == 1 else int(code.co_firstlineno)


def _numbers(value: Any, name: str, axes: int) -> Any:
    try:
        array = np.asarray(value)
    except ValueError:  # parts of different lengths
        array = np.empty(0, dtype=object)
    right = not is_masked(value) and array.dtype.kind in "fiu" and (array.shape == (axes,) if axes else array.size == 1)
    if not right or not np.isfinite(array).all():
        raise ValueError(f"the signal {name!r} is {shown(value)}")
    return array.astype(float).tolist() if axes else float(array.reshape(-1)[0])
