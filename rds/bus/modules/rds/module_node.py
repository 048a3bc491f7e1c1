"""A module that answers the cyclic frames of rds/bus/modules/rds/frames.py, on a bus."""

from __future__ import annotations

from collections.abc import Callable

import can

from rds.bus.modules.bus_node import BusNode, Outgoing
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.module import AxisModule
from rds.bus.modules.rds.motion_frames import CONTROL


class ModuleNode(BusNode):
    """The module that `make_module` makes, given the bus time now, s; its own clock is `drift` ppm faster than that."""

    def __init__(
        self,
        name: str,
        make_module: Callable[[float], AxisModule],
        open_bus: Callable[[list[int]], can.BusABC],
    ):
        super().__init__(name, open_bus)
        self._switched_on = self.clock.now()
        self.module = make_module(self._switched_on)
        self.join()

    @property
    def identifiers(self) -> list[int]:
        """The cyclic exchange, and the emergency stop of all."""
        return [frames.GENERAL, *self.module.hears]

    @property
    def expires(self) -> float | None:
        """The module's own: when its watchdog cuts the voltage."""
        return self.module.expires

    @property
    def heard(self) -> float:
        """Ticks."""
        return self.module.ticks

    @property
    def number(self) -> int:
        """Its node."""
        return self.module.identity.node

    def receive(self, message: can.Message, at: float) -> list[Outgoing]:
        """To the module; extended and remote frames mean nothing to it."""
        if message.is_extended_id or message.is_remote_frame:
            return []
        if message.arbitration_id == frames.CALL and message.data == frames.TIME:
            shown = max(0.0, at - self._switched_on) * (1.0 + self.module.drift)
            return [(*frames.encode_clock(self.module.identity.node, shown), True)]
        if message.arbitration_id == CONTROL:
            told = self.module.control(message.data, at)
            return [] if told is None else [(*told, True)]
        answers = self._answers(self.module.receive(message.arbitration_id, message.data, at))
        if self.module.cell is not None and answers and message.arbitration_id in (frames.COMMAND, frames.DRY_COMMAND):
            return [*answers, *((frames.FORCE, data, False) for data in self.module.force())]
        if message.arbitration_id == frames.CALL and message.data == frames.WHO:
            return [(*frames.encode_identity(self.module.identity), True), *answers]
        return answers

    def expire(self, now: float) -> list[Outgoing]:
        """The module's."""
        return self._answers(self.module.expire(now))

    def press(self, active: bool) -> None:
        """The module's emergency stop button: pressed, it stops this module, which stops all others on its bus.

        can.CanError if the bus fails; this module has stopped even so.
        """
        reports = self.module.set_emergency_input(active, self.clock.now())
        if reports:
            self.send([(frames.GENERAL, frames.EMERGENCY, False)])
        self.send(self._answers(reports))

    def _answers(self, answers: list[bytes]) -> list[Outgoing]:
        return [(self.module.identifier, data, False) for data in answers]
