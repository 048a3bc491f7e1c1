"""The serial fieldbus as one of the dialects there are: see `rds.bus.modules.dialects`."""

from __future__ import annotations

from typing import Any

from rds.bus.hub.bus_settings import SERIAL
from rds.bus.modules.dcs.frames import IDENTIFIERS
from rds.core.contracts import Drivers
from rds.machines.machine import Machine

__all__ = ["IDENTIFIERS", "SERVED_WITH", "answers", "drivers"]
SERVED_WITH = ("drift",)


def drivers() -> type[Drivers]:
    """The host's drivers, imported now: they need python-can."""
    from rds.bus.modules.dcs.drivers import DcsDrivers

    return DcsDrivers


def answers(machine: Machine, interface: str, channel: str | None, **options: Any) -> bool:
    """Whether units of `machine` answer on a serial line; a CAN bus has none."""
    from rds.bus.modules.dcs.calling import find_units

    return interface == SERIAL and bool(find_units(machine, channel, **options))
