"""The places outside its arguments in which a function could remember something, and which of them changed."""

from __future__ import annotations

import copy
import inspect
from collections.abc import Callable, Iterator
from functools import partial
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

from rds.checks.values import same
from rds.core.traceback_frames import is_installed

_OUTSIDE = frozenset({"time", "random", "perf_counter", "monotonic", "datetime", "now", "default_rng", "randn", "rand"})


def remembered(function: Callable[..., Any]) -> dict[str, Any]:
    """A copy of everything that `function`, or a function of the student's that it calls, could remember in.

    Keys name the place for a message: "global `total`", "default argument `memory` of control()". What cannot
    be copied is left out.
    """
    found: dict[str, Any] = {}
    for place, value in _places(function, set()):
        try:
            found[place] = copy.deepcopy(value)
        except Exception:
            if type(value).__module__ == "itertools":  # from Python 3.14 on, whose text tells where it is: `count(5)`
                found[place] = repr(value)
            continue  # generators, open files and locks have no copy
    return found


def changed(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """The places whose content is no longer the same."""
    return [place for place, value in after.items() if place not in before or not same(before[place], value)]


def outside_sources(function: Callable[..., Any]) -> list[str]:
    """Names that the function or its helpers use and that bring in the clock or chance."""
    names: set[str] = set()
    for part in _functions(function, set()):
        names |= _names(part.__code__)
    return sorted(names & _OUTSIDE)


def _places(function: Any, seen: set[int]) -> Iterator[tuple[str, Any]]:
    if id(function) in seen:
        return
    seen.add(id(function))
    if isinstance(function, partial):
        yield f"arguments of partial {_name(function.func)}()", [list(function.args), function.keywords]
        yield from _places(function.func, seen)
    elif isinstance(function, MethodType):
        yield f"object of {_name(function)}()", _attributes(function.__self__)
        yield from _places(function.__func__, seen)
    elif isinstance(function, FunctionType):
        yield from _function_places(function, seen)
    elif isinstance(function, ModuleType):
        for name, value in vars(function).items():
            if not name.startswith("__") and not isinstance(value, ModuleType | type) and not callable(value):
                yield f"global `{name}` of {function.__name__}", value
    elif isinstance(function, type):
        for name, value in vars(function).items():
            if isinstance(value, FunctionType):
                yield from _places(value, seen)
            elif not name.startswith("__") and not callable(value) and not inspect.isdatadescriptor(value):
                yield f"class attribute `{function.__name__}.{name}`", value
    elif callable(function):
        wrapped = getattr(function, "__wrapped__", None)
        if wrapped is not None:  # a cache or a compiled function: what it keeps cannot change its answers
            yield from _places(wrapped, seen)
        else:
            yield f"object {type(function).__name__}", _attributes(function)
            yield from _places(vars(type(function)).get("__call__"), seen)


def _function_places(function: FunctionType, seen: set[int]) -> Iterator[tuple[str, Any]]:
    name = function.__name__
    for parameter in _parameters(function):
        if parameter.default is not parameter.empty:
            yield f"default argument `{parameter.name}` of {name}()", parameter.default
    for key, value in vars(function).items():
        if key == "__wrapped__":
            yield from _places(value, seen)
        else:
            yield f"attribute `{name}.{key}`", value
    for variable, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            value = cell.cell_contents
        except ValueError:  # not yet filled
            continue
        yield from _variable(f"variable `{variable}` around {name}()", value, seen)
    for variable in sorted(_names(function.__code__)):
        if variable in function.__globals__:
            yield from _variable(f"global `{variable}`", function.__globals__[variable], seen)


def _variable(place: str, value: Any, seen: set[int]) -> Iterator[tuple[str, Any]]:
    if isinstance(value, ModuleType | type | FunctionType | MethodType | BuiltinFunctionType | partial):
        if _is_student(value):
            yield from _places(value, seen)
    else:
        yield place, value
        if _is_student(type(value)):
            yield from _places(type(value), seen)


def _functions(function: Any, seen: set[int]) -> Iterator[FunctionType]:
    function = getattr(function, "func", getattr(function, "__func__", function))
    if not isinstance(function, FunctionType) or id(function) in seen:
        return
    seen.add(id(function))
    yield function
    for name in _names(function.__code__):
        value = function.__globals__.get(name)
        if isinstance(value, FunctionType) and _is_student(value):
            yield from _functions(value, seen)


def _names(code: CodeType) -> set[str]:
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            names |= _names(constant)
    return names


def _is_student(value: Any) -> bool:
    try:
        return not is_installed(inspect.getfile(value.func if isinstance(value, partial) else value))
    except (TypeError, OSError):  # built in, or written in no file
        return getattr(value, "__module__", "builtins") not in ("builtins", None) and not isinstance(value, ModuleType)


def _parameters(function: FunctionType) -> list[inspect.Parameter]:
    try:
        return list(inspect.signature(function, follow_wrapped=False).parameters.values())
    except (TypeError, ValueError):
        return []


def _attributes(value: Any) -> Any:
    return getattr(value, "__dict__", None)


def _name(function: Any) -> str:
    return getattr(function, "__qualname__", type(function).__name__)
