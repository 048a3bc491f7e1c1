"""A simulated drive on a bus."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import can

from rds.bus.modules.bus_node import BusNode, Outgoing
from rds.bus.modules.cia402 import lss
from rds.bus.modules.cia402.drive import NMT, Drive, Frame
from rds.bus.modules.cia402.quirks import Quirk


class DriveNode(BusNode):
    """The drive that `make_drive` makes, given the bus time now, s, and its node-ID (None: its axis's).

    One that has no node-ID yet listens to LSS alone, and boots when it gets one.
    """

    def __init__(
        self, name: str, make_drive: Callable[[float, int | None], Drive], open_bus: Callable[[list[int]], can.BusABC]
    ):
        super().__init__(name, open_bus)
        self._make_drive = make_drive
        self.drive = make_drive(self.clock.now(), None)
        is_new = Quirk.NO_NODE_ID in self.drive.quirks
        self._lss = lss.Slave(self._identity, lss.UNCONFIGURED if is_new else self.drive.node, self._take_node_id)
        self._filter = self._wanted()
        self.join()
        if not is_new:
            self.send(_standard(self.drive.boot(self.clock.now())))

    @property
    def identifiers(self) -> list[int]:
        """NMT, SYNC, its SDO and PDOs."""
        return sorted(self._filter)

    @property
    def expires(self) -> float | None:
        """The drive's own."""
        return self.drive.expires if self._is_configured else None

    @property
    def heard(self) -> float:
        """SYNCs."""
        return self.drive.syncs

    def receive(self, message: can.Message, at: float) -> Iterable[Outgoing]:
        """To the drive; extended frames mean nothing to it."""
        if message.is_extended_id:
            return ()
        if message.arbitration_id == lss.REQUEST:
            answer = self._lss.receive(bytes(message.data))
            return () if answer is None else _standard([(lss.ANSWER, answer)])
        if not self._is_configured:
            return ()
        frames = self.drive.receive(message.arbitration_id, message.data, at, message.is_remote_frame)
        if message.arbitration_id in (NMT, 0x600 + self.drive.node):  # which may change what it listens to
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

    @property
    def _is_configured(self) -> bool:
        return self._lss.node != lss.UNCONFIGURED

    def _identity(self) -> lss.Identity:
        vendor, product, revision = (self.drive.objects.values[0x1018, place] for place in (1, 2, 3))
        return vendor, product, revision, self.drive.serial

    def _take_node_id(self, node: int) -> None:
        """LSS has given it a node-ID: it boots with that."""
        serial = self.drive.serial
        self.drive = self._make_drive(self.clock.now(), node)
        self.drive.serial = serial
        self._keep_filter()
        self.send(_standard(self.drive.boot(self.clock.now())))

    def _wanted(self) -> frozenset[int]:
        return (self.drive.listens_to if self._is_configured else frozenset()) | {lss.REQUEST}

    def _keep_filter(self) -> None:
        """The host may have given a PDO another identifier: listen to that from now on."""
        wanted = self._wanted()
        if wanted != self._filter and self.bus is not None:
            self._filter = wanted
            self.bus.set_filters(
                [{"can_id": identifier, "can_mask": 0x7FF, "extended": False} for identifier in sorted(wanted)]
            )


def _standard(frames: Iterable[Frame]) -> list[Outgoing]:
    return [(identifier, data, False) for identifier, data in frames]
