"""The cyclic side of oacs modules: `rds.core.contracts.Drivers`.

Modules answer the cyclic frames of every machine, so the drivers are those of every machine; only the start knows
more: it refuses a bus on which two modules share a number, and modules whose emergency stop is latched.
"""

from __future__ import annotations

from rds.bus.modules.oacs.host import refuse_clashes, survey
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.core.errors import MachineError


class OacsDrivers(AxisDrivers):
    """As AxisDrivers, for the modules of the oacs dialect. A `bus` that is handed in must not filter frames."""

    def _refuse_company(self) -> None:
        """MachineError also for numbers that are used twice, and for an emergency stop that is latched."""
        if self._owns_bus:
            self._bus.set_filters(None)
        found = survey(self._bus)
        refuse_clashes(found)
        emergency = {info.id for info in found if info.state == "emergency"}
        latched = [module.axis.name for module in self._modules if module.axis.node in emergency]
        if latched:
            raise MachineError(
                f"the emergency stop of {', '.join(latched)} is latched; release the button, then reset it"
            )
        super()._refuse_company()
