"""Part programs: the language (RS274NGC as LinuxCNC documents it), and what its programs tell a machine to do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rds.nc.language.dialect import Dialect as Dialect
    from rds.nc.language.errors import ProgramError as ProgramError
    from rds.nc.language.interpreter import interpret as interpret

_HOMES = {"Dialect": "language.dialect", "ProgramError": "language.errors", "interpret": "language.interpreter"}

__all__ = ["Dialect", "ProgramError", "interpret"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
