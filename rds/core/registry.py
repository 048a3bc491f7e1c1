"""A door: a table from name to module, where a module is imported only when its name is used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

from rds.core.errors import InputError
from rds.core.quantities import near


@dataclass(frozen=True)
class Registry:
    """The library parts of one kind ("controller", "model", ...), by name."""

    kind: str
    modules: Mapping[str, str]
    own: bool = True  # whether a user's file may stand in for a library part

    def names(self) -> list[str]:
        """The names behind this door, in the order of the table."""
        return list(self.modules)

    def module(self, name: str) -> ModuleType:
        """The module called `name`, imported now if it was not before; InputError lists the known names."""
        if name not in self.modules:
            own = ", or your own from a file" if self.own else ""
            known = f"known {self.kind}s: {', '.join(self.modules)}{own}"
            raise InputError(f"there is no {self.kind} {name!r}; {known}{near(name, self.names())}")
        return import_module(self.modules[name])
