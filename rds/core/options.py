"""Options that users give by name: unknown names are refused, values are checked by their declarations."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import Quantity, near


def check_known(given: Iterable[str], known: Iterable[str], owner: str) -> None:
    """InputError naming the first option that `owner` does not have, and listing those that it has."""
    table = list(known)
    for name in given:
        if name not in table:
            has = f"it has {', '.join(table)}" if table else "it has none"
            raise InputError(f"{owner} has no option {name!r}; {has}{near(name, table)}")


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
