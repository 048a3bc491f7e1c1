"""Modes by name, imported on use. Each file has `MODE`, which says what others must know of it (`loop/mode.py`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rds.core.errors import InputError
from rds.core.quantities import near
from rds.core.registry import Registry

if TYPE_CHECKING:
    from rds.modes.loop.mode import Drive, Mode

SIMULATION, EMULATION, SYSTEM_TEST = "simulation", "emulation", "system-test"  # those that others ask for by name
DEFAULT = SIMULATION
MODES = Registry(
    "mode",
    {
        SIMULATION: "rds.modes.simulation",
        EMULATION: "rds.modes.emulation",
        "implementation": "rds.modes.implementation",
        SYSTEM_TEST: "rds.modes.system_test",
        "model-validation": "rds.modes.model_validation",
    },
    own=False,
)


def mode_names(drives: Drive | None = None) -> list[str]:
    """The modes there are; with `drives`, those in which that may drive the axes."""
    names = MODES.names()
    return names if drives is None else [name for name in names if drives in load_mode(name).drives]


def load_mode(name: str) -> Mode:
    """The mode called `name`; InputError lists the ones there are."""
    if name not in MODES.modules:
        raise InputError(f"unknown mode {name!r}; known modes: {', '.join(MODES.modules)}{near(name, MODES.names())}")
    mode: Mode = MODES.module(name).MODE
    return mode
