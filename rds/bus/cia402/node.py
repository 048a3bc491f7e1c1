"""A simulated drive on a bus: its connection, its notion of bus time, and what to do when the bus fails."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence

import can

from rds.bus.cia402.drive import NMT, Drive, Frame
from rds.bus.module_node import RETRY, BusTime
from rds.core.errors import MachineError

LOG = logging.getLogger(__name__)

_SEND_TIMEOUT = 0.1  # s


class DriveNode:
    """One drive with a bus of its own, which `open_bus(identifiers)` opens and opens again after a failure."""

    def __init__(self, make_drive: Callable[[float], Drive], open_bus: Callable[[Sequence[int]], can.BusABC]):
        self._clock = BusTime()
        self.drive = make_drive(self._clock.now())
        self._open_bus = open_bus
        self._filter = self.drive.listens_to
        self.bus: can.BusABC | None = open_bus(sorted(self._filter))
        self._retry_at = 0.0
        self._configuring = (NMT, 0x600 + self.drive.node)  # identifiers that may change what it listens to
        self._send(self.drive.boot(self._clock.now()))

    def patience(self) -> float | None:
        """How long the node may sleep if no frame comes, s."""
        if self.bus is None:
            return max(0.0, self._retry_at - time.monotonic())
        expires = self.drive.expires
        return None if expires is None else max(0.0, expires - self._clock.now())

    def step(self, timeout: float) -> bool:
        """Take one frame, waiting for it at most `timeout` s, and look after the drive's time; false if none came.

        A bus that fails is closed and reported; the axis goes on, and so do the drive's time-outs.
        """
        message = None
        try:
            if self.bus is not None:
                message = self.bus.recv(timeout)
            if message is not None and not message.is_error_frame and not message.is_extended_id:
                at = self._clock.at(message.timestamp)
                remote = message.is_remote_frame
                frames = self.drive.receive(message.arbitration_id, message.data, at, remote)
                if message.arbitration_id in self._configuring:
                    self._keep_filter()
                self._send(frames)
            elif message is None:
                expires = self.drive.expires
                if expires is not None and expires <= (now := self._clock.now()):
                    self._send(self.drive.expire(now))
        except (can.CanError, OSError) as error:
            LOG.error("drive %s lost its bus: %s; trying again every %g s", self.drive.name, error, RETRY)
            self.close()
            self._retry_at = time.monotonic() + RETRY
        return message is not None

    def fault(self, code: int) -> None:
        """Inject a fault by its error code, now."""
        self._send(self.drive.fault(code, self._clock.now()))

    def reopen(self) -> bool:
        """Open the bus again if it failed and it is time to; true if it did."""
        if self.bus is not None or time.monotonic() < self._retry_at:
            return False
        try:
            self.bus = self._open_bus(sorted(self._filter))
        except MachineError as error:
            LOG.error("drive %s: %s", self.drive.name, error)
            self._retry_at = time.monotonic() + RETRY
            return False
        LOG.warning("drive %s is back on its bus", self.drive.name)
        return True

    def close(self) -> None:
        """Leave the bus."""
        bus, self.bus = self.bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except (can.CanError, OSError) as error:
                LOG.warning("drive %s could not close its bus: %s", self.drive.name, error)

    def _keep_filter(self) -> None:
        """The host may have given a PDO another identifier: listen to that from now on."""
        wanted = self.drive.listens_to
        if wanted != self._filter and self.bus is not None:
            self._filter = wanted
            self.bus.set_filters(
                [{"can_id": identifier, "can_mask": 0x7FF, "extended": False} for identifier in sorted(wanted)]
            )

    def _send(self, frames: Sequence[Frame]) -> None:
        if self.bus is None:
            return
        for identifier, data in frames:
            self.bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data), _SEND_TIMEOUT)
