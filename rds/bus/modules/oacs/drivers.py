"""The cyclic side of oacs modules: `rds.core.contracts.Drivers`.

Modules answer the cyclic frames of every machine, so the drivers are those of every machine; only the start knows
more: it refuses a bus on which two modules share a number, and modules whose emergency stop is latched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import can

from rds.bus.modules.oacs.host import refuse_clashes, survey
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.bus.tools.link import BUILTIN, default_channel, open_bus
from rds.core.errors import MachineError
from rds.machines.machine import Machine

_OF_DRIVERS = ("sample_period", "dry_run", "timeout")  # options that are not the interface's


class OacsDrivers(AxisDrivers):
    """As AxisDrivers, for the modules of the oacs dialect. A `bus` that is handed in must not filter frames."""

    def __init__(
        self,
        machine: Machine,
        axes: Sequence[str] | None = None,
        *,
        bus: can.BusABC | None = None,
        interface: str = BUILTIN,
        channel: str | None = None,
        **options: Any,
    ):
        super().__init__(machine, axes, bus=bus, interface=interface, channel=channel, **options)
        self._shared = bus
        self._numbers = {machine.axis(name).node: name for name in (axes if axes is not None else machine.axes)}
        self._where = (interface, default_channel(machine, interface, channel))
        self._options = {key: value for key, value in options.items() if key not in _OF_DRIVERS}

    def _refuse_company(self) -> None:
        """MachineError also for numbers that are used twice, and for an emergency stop that is latched."""
        bus = self._shared if self._shared is not None else open_bus(*self._where, **self._options)
        try:
            found = survey(bus)
        finally:
            if self._shared is None:
                bus.shutdown()
        refuse_clashes(found)
        emergency = {info.id for info in found if info.state == "emergency"}
        latched = [name for number, name in self._numbers.items() if number in emergency]
        if latched:
            raise MachineError(
                f"the emergency stop of {', '.join(latched)} is latched; release the button, then reset it"
            )
        super()._refuse_company()
