"""The functions of the three fixed interfaces: their names, their arguments, and what a student wrote instead."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType, ModuleType
from typing import Any

ARGUMENTS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "control": ("t", "r", "y", "state", "params"),
        "derivatives": ("t", "x", "u", "params"),
        "advance": ("x", "u", "T", "params"),
        "output": ("t", "x", "u", "params"),
        "interpolate": ("segment", "T", "params"),
    }
)
"""Arguments of each function of an interface, in order."""

INTERFACES: Mapping[str, str] = MappingProxyType(
    {"control": "controller", "derivatives": "model", "advance": "model", "interpolate": "interpolator"}
)
"""Which interface a function fills; `output` only accompanies a model."""


def form(name: str) -> str:
    """The function as the interface writes it: "control(t, r, y, state, params)"."""
    return f"{name}({', '.join(ARGUMENTS[name])})"


_STEPS = {  # of a linear system's matrices
    "control": "return C @ x + D @ u and the next state A @ x + B @ u",
    "derivatives": "return A @ x + B @ u",
    "advance": "return A @ x + B @ u",
}


def argument_fault(name: str, function: Callable[..., Any]) -> str | None:
    """What is wrong with the arguments of `function` in the role `name`, with the remedy; None if nothing is."""
    wanted = ARGUMENTS[name]
    if type(function).__module__.partition(".")[0] == "control":
        kind = type(function).__name__
        steps = f"; in it {_STEPS[name]}" if name in _STEPS and hasattr(function, "A") else ""
        return f"`{name}` is a {kind} of python-control, and no function: write `def {form(name)}`{steps}"
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # built-in and compiled functions need not tell
        return None
    names = [p.name for p in signature.parameters.values()]
    remedy = f"write it as `def {form(name)}`"
    try:
        signature.bind(*wanted)
    except TypeError as error:
        missing = [argument for argument in wanted if argument not in names]
        hint = f" ({', '.join(missing)} missing)" if missing and len(names) < len(wanted) else ""
        return f"{name}{signature} cannot be called as {form(name)}: {error}{hint}; {remedy}"
    for place, argument in enumerate(names[: len(wanted)]):
        if argument in wanted and wanted[place] != argument:
            return (
                f"{name}{signature} has `{argument}` in place {place + 1}, where it will be given "
                f"`{wanted[place]}`; {remedy}"
            )
    return None


def near_misses(namespace: Mapping[str, Any]) -> str:
    """A sentence about what in `namespace` was probably meant as an interface function, or ""."""
    for name, value in namespace.items():
        if isinstance(value, type):
            if name in INTERFACES:
                return f"its `{name}` is a class; write a function, `def {form(name)}`"
            for method in INTERFACES:
                if callable(getattr(value, method, None)):
                    return f"class {name} has a method {method}(); make it a plain function outside of any class"
        elif callable(value) and not name.startswith("_"):
            close = difflib.get_close_matches(name.lower(), list(INTERFACES), n=1, cutoff=0.7)
            if close:
                return f"it has {name}(); did you mean {close[0]}()?"
    for name in INTERFACES:
        value = namespace.get(name)
        if isinstance(value, ModuleType):
            return f"its `{name}` is the imported module, not a function; import it by another name"
        if value is not None and not callable(value):
            return f"its `{name}` is {value!r:.60}, not a function"
    return ""
