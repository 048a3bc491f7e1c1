"""Modes by name, imported on use."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from rds.core.errors import InputError

if TYPE_CHECKING:
    from rds.modes.loop.mode import Mode

_MODULES = {
    "simulation": "simulation",
    "emulation": "emulation",
    "implementation": "implementation",
    "system-test": "system_test",
    "model-validation": "model_validation",
}


def mode_names() -> list[str]:
    """The modes there are."""
    return list(_MODULES)


def load_mode(name: str) -> Mode:
    """The mode called `name`; InputError lists the ones there are."""
    if name not in _MODULES:
        raise InputError(f"unknown mode {name!r}; known modes: {', '.join(_MODULES)}")
    mode: Mode = import_module(f"rds.modes.{_MODULES[name]}").MODE
    return mode
