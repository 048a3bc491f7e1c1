"""Options that users give by name: unknown names are refused, values are checked by their declarations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from inspect import Parameter, signature
from typing import Any, ParamSpec, TypeVar

from rds.core.errors import InputError
from rds.core.quantities import Quantity, near

P = ParamSpec("P")
T = TypeVar("T")


def known_keywords(function: Callable[P, T]) -> Callable[P, T]:
    """The function, which refuses an unknown keyword argument with an InputError that names the nearest known one."""
    parameters = signature(function).parameters.values()
    if any(each.kind is Parameter.VAR_KEYWORD for each in parameters):
        return function
    known = [each.name for each in parameters if each.kind is not Parameter.POSITIONAL_ONLY and each.name != "self"]
    owner = function.__qualname__.removesuffix(".__init__")

    @wraps(function)
    def call(*given: P.args, **named: P.kwargs) -> T:
        if not named.keys() <= {*known}:
            check_known(named, known, f"{owner}()", "argument")
        return function(*given, **named)

    return call


def check_known(given: Iterable[str], known: Iterable[str], owner: str, kind: str = "option") -> None:
    """InputError naming the first option that `owner` does not have, and listing those that it has."""
    table = list(known)
    for name in given:
        if name not in table:
            has = f"it has {', '.join(table)}" if table else "it has none"
            raise InputError(f"{owner} has no {kind} {name!r}; {has}{near(name, table)}")


def read_options(given: Mapping[str, Any], options: Mapping[str, Quantity], owner: str) -> dict[str, float]:
    """The options that were given, as checked floats. Raises InputError for an unknown name or a bad value."""
    check_known(given, options, owner)
    return {name: options[name].check(value, name, owner) for name, value in given.items()}


def read_all(
    given: Mapping[str, Any], options: Mapping[str, Quantity], owner: str, defaults: Mapping[str, float]
) -> dict[str, float]:
    """Every option, those not given from `defaults`. InputError as `read_options`, and for one that is in neither."""
    values = {**defaults, **read_options(given, options, owner)}
    for name, option in options.items():
        if name not in values:
            raise InputError(f"{owner} needs {name} ({option.described})")
    return values
