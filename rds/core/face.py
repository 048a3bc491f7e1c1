"""What a room offers to its users beside its files: names that are imported when they are first used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def face(room: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of the package `room`.

    `homes` says where each name is defined: "language.dialect" below the room, or "check:motion" where it is called
    otherwise there.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {room!r} has no attribute {name!r}; it offers {', '.join(sorted(homes))}")
        module, _, called = homes[name].partition(":")
        return getattr(import_module(f"{room}.{module}"), called or name)

    return get, lambda: sorted(homes)
