"""CiA 402 as one of the dialects there are: see `rds.bus.modules.dialects`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rds.bus.modules.cia402.codes import IDENTIFIERS
from rds.core.contracts import Drivers
from rds.machines.machine import Machine

__all__ = ["IDENTIFIERS", "SERVED_WITH", "answers", "commands", "drivers"]
SERVED_WITH = ("quirks", "eds")


def drivers() -> type[Drivers]:
    """The host's drivers, imported now: they need python-can."""
    from rds.bus.modules.cia402.host import Cia402Drivers

    return Cia402Drivers


def answers(_machine: Machine, interface: str, channel: str | None, **options: Any) -> bool:
    """Whether drives answer. Any will do: which of them are the machine's is asked when they are enabled."""
    from rds.bus.modules.cia402.scan import scan

    return any(device.is_drive for device in scan(interface, channel, **options))


def commands(machine: Machine, axes: Sequence[str], bus: Mapping[str, Any]) -> dict[str, str]:
    """What each axis is commanded by, of [bus.cia402]. InputError for a table that will not do."""
    from rds.bus.modules.cia402.settings import commands as by_settings

    return by_settings(bus.get("cia402") or {}, machine, axes)
