"""The cyclic side of oacs modules: `rds.core.contracts.Drivers`.

Modules answer the cyclic frames of every machine, so the drivers are those of every machine; only the start knows
more: it refuses a bus on which two modules share a number, modules whose emergency stop is latched, and those that
count otherwise than the machine's file says, as a module of another machine does.
"""

from __future__ import annotations

from rds.bus.modules.oacs.host import refuse_clashes, survey
from rds.bus.modules.oacs.remote import Module
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.core.errors import MachineError

_ROUNDING = 1e-3  # of a resolution that is written with few digits


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
        numbers = {info.id for info in found}
        for axis in (module.axis for module in self._modules if module.axis.node in numbers):
            if axis.is_spindle:
                continue
            says = Module(self._bus, axis.node, axis.name).download()
            if says.unit != axis.unit or abs(says.counts_per_unit * axis.resolution - 1.0) > _ROUNDING:
                raise MachineError(
                    f"{axis.name}: module {axis.node} ({says.type_text}, serial number {says.serial}) has "
                    f"{says.counts_per_unit:g} counts per {says.unit}, where the machine's file says "
                    f"{1.0 / axis.resolution:g} per {axis.unit}; connect or serve the right one, or correct the file"
                )
        super()._refuse_company()
