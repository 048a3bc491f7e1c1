"""RDS: the rapid development system for machine-tool axes.

The names below are imported when they are first used, so that `import rds` is light.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_NAMES = {
    "Experiment": "rds.modes.experiment",
    "Result": "rds.results",
    "compare": "rds.results.compare",
    "open_result": "rds.results",
    "load_machine": "rds.machines",
    "machine_names": "rds.machines",
    "Controller": "rds.core.types",
    "Model": "rds.core.types",
    "Reference": "rds.core.types",
    "LineSegment": "rds.core.types",
    "ArcSegment": "rds.core.types",
    "sinusoid": "rds.references",
    "square": "rds.references",
    "triangle": "rds.references",
    "constant": "rds.references",
    "multisine": "rds.references",
    "chirp": "rds.references",
    "staircase": "rds.references",
    "user": "rds.references",
    "check_file": "rds.checks",
    "check_controller": "rds.checks",
    "check_model": "rds.checks",
    "check_interpolator": "rds.checks",
    "RdsError": "rds.core.errors",
    "InputError": "rds.core.errors",
    "ContractError": "rds.core.errors",
    "MachineError": "rds.core.errors",
}

__all__ = list(_NAMES)


def __getattr__(name: str) -> Any:
    if name not in _NAMES:
        raise AttributeError(f"module 'rds' has no attribute {name!r}")
    return getattr(import_module(_NAMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_NAMES])
