"""A simulated drive on a bus."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import can

from rds.bus.modules.bus_node import BusNode, Outgoing
from rds.bus.modules.cia402.drive import NMT, Drive, Frame


class DriveNode(BusNode):
    """The drive that `make_drive` makes, given the bus time now, s."""

    def __init__(self, name: str, make_drive: Callable[[float], Drive], open_bus: Callable[[list[int]], can.BusABC]):
        super().__init__(name, open_bus)
        self.drive = make_drive(self.clock.now())
        self._filter = self.drive.listens_to
        self._configuring = (NMT, 0x600 + self.drive.node)  # identifiers that may change what it listens to
        self.join()
        self.send(_standard(self.drive.boot(self.clock.now())))

    @property
    def identifiers(self) -> list[int]:
        """NMT, SYNC, its SDO and PDOs."""
        return sorted(self._filter)

    @property
    def expires(self) -> float | None:
        """The drive's own."""
        return self.drive.expires

    @property
    def heard(self) -> float:
        """SYNCs."""
        return self.drive.syncs

    def receive(self, message: can.Message, at: float) -> Iterable[Outgoing]:
        """To the drive; extended frames mean nothing to it."""
        if message.is_extended_id:
            return ()
        frames = self.drive.receive(message.arbitration_id, message.data, at, message.is_remote_frame)
        if message.arbitration_id in self._configuring:
            self._keep_filter()
        return _standard(frames)

    def expire(self, now: float) -> Iterable[Outgoing]:
        """The drive's."""
        return _standard(self.drive.expire(now))

    def fault(self, code: int) -> None:
        """Inject a fault by its error code, now."""
        self.send(_standard(self.drive.fault(code, self.clock.now())))

    @property
    def number(self) -> int:
        """Its node-ID."""
        return self.drive.node

    def press(self, active: bool) -> None:
        """Its emergency stop button."""
        self.send(_standard(self.drive.set_emergency_input(active, self.clock.now())))

    def _keep_filter(self) -> None:
        """The host may have given a PDO another identifier: listen to that from now on."""
        wanted = self.drive.listens_to
        if wanted != self._filter and self.bus is not None:
            self._filter = wanted
            self.bus.set_filters(
                [{"can_id": identifier, "can_mask": 0x7FF, "extended": False} for identifier in sorted(wanted)]
            )


def _standard(frames: Iterable[Frame]) -> list[Outgoing]:
    return [(identifier, data, False) for identifier, data in frames]
