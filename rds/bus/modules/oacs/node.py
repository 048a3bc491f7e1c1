"""A virtual module on a bus."""

from __future__ import annotations

from collections.abc import Callable

import can

from rds.bus.modules.bus_node import BusNode
from rds.bus.modules.oacs.messages import Frame
from rds.bus.modules.oacs.module import OacsModule


class OacsNode(BusNode):
    """The module that `make_module` makes, given the bus time now, s."""

    def __init__(
        self, name: str, make_module: Callable[[float], OacsModule], open_bus: Callable[[list[int]], can.BusABC]
    ):
        super().__init__(name, open_bus)
        self.module = make_module(self.clock.now())
        self.join()

    @property
    def identifiers(self) -> list[int]:
        """General calls, its own commands, the cyclic exchange."""
        return self.module.identifiers

    @property
    def expires(self) -> float | None:
        """The module's own."""
        return self.module.expires

    @property
    def heard(self) -> float:
        """When the host last said something."""
        return self.module.mover.heard

    def receive(self, message: can.Message, at: float) -> list[Frame]:
        """To the module; remote frames mean nothing to it."""
        if message.is_remote_frame:
            return []
        return self.module.receive(message.arbitration_id, message.data, at, message.is_extended_id)

    def expire(self, now: float) -> list[Frame]:
        """The module's."""
        return self.module.expire(now)
