"""The rds dialect as one of the dialects there are: see `rds.bus.modules.dialects`."""

from __future__ import annotations

from typing import Any

from rds.bus.modules.rds.frames import IDENTIFIERS
from rds.core.contracts import Drivers
from rds.machines.machine import Machine

__all__ = ["IDENTIFIERS", "SERVED_WITH", "answers", "drivers"]
SERVED_WITH = ("drift", "cut")


def drivers() -> type[Drivers]:
    """The host's drivers, imported now: they need python-can."""
    from rds.bus.modules.rds.drivers import AxisDrivers

    return AxisDrivers


def answers(machine: Machine, interface: str, channel: str | None, **options: Any) -> bool:
    """Whether modules of `machine` answer that follow cyclic commands and nothing else."""
    from rds.bus.modules.calling import answering

    nodes, distributed = answering(machine, interface, channel, **options)
    return bool(nodes - distributed)
