"""What drawings need besides the core: the extra `drawing`, imported by those who trace."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from rds.core.extras import needed_for


def needed(module: str) -> ModuleType:
    """A module of the extra `drawing`; InputError with the command that installs it where it is missing."""
    with needed_for("tracing a drawing"):
        return import_module(module)
