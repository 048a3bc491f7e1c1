"""Options that several commands share, declared once: a NamedTuple whose fields are options, taken as one parameter."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from functools import cache, wraps
from inspect import Parameter
from typing import Any, get_type_hints


def take(command: Callable[..., Any], parameters: Iterable[Parameter]) -> None:
    """Let typer find these parameters at `command`."""
    signature = inspect.Signature(list(parameters))
    command.__signature__ = signature  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in signature.parameters.values()}


@cache
def _options(group: Any) -> list[Parameter]:
    hints = get_type_hints(group, include_extras=True)
    defaults = group._field_defaults.items()
    return [Parameter(name, Parameter.KEYWORD_ONLY, default=of, annotation=hints[name]) for name, of in defaults]


def grouped_options(command: Callable[..., None]) -> Callable[..., None]:
    """The same command for typer, which asks for each option of a group where `command` takes the group."""
    groups: dict[str, Any] = {}
    parameters: list[Parameter] = []
    hints = get_type_hints(command, include_extras=True)  # words, until now: typer would miss what options are called
    for each in inspect.signature(command).parameters.values():
        if hasattr(hints[each.name], "_field_defaults"):
            groups[each.name] = hints[each.name]
            parameters += _options(hints[each.name])
        else:
            parameters.append(each.replace(kind=Parameter.KEYWORD_ONLY, annotation=hints[each.name]))

    @wraps(command)
    def with_options(*words: Any, **given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{option: given.pop(option) for option in group._fields if option in given})
        command(*words, **given)

    take(with_options, parameters)
    return with_options
