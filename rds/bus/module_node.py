"""A module on a bus: its connection, its notion of bus time, and what to do when the bus fails."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import can

from rds.bus import frames
from rds.bus.module import AxisModule
from rds.core.errors import MachineError

LOG = logging.getLogger(__name__)

LISTENS_TO = (frames.GENERAL, frames.COMMAND, frames.DRY_COMMAND, frames.SETUP, frames.CALL)
LISTEN_MASK = 0x7FF
RETRY = 0.5  # s between attempts to open a bus that failed
_SEND_TIMEOUT = 0.1  # s


class BusTime:
    """Bus time from time stamps: from frame to frame it never goes back, and between goes on by the local clock. In s.

    A stamp's clock may be stepped (some interfaces stamp with the wall clock); then time goes on from where it was.
    To ask for the time now changes nothing: a frame that is still under way may have been stamped before.
    """

    def __init__(self) -> None:
        self._last = time.time()
        self._shift = 0.0  # bus time less stamp
        self._offset = self._last - time.monotonic()  # bus time less local clock

    def at(self, stamp: float) -> float:
        """The bus time of a frame stamped `stamp`, which has just been received; a stamp of 0 means none."""
        if not stamp:
            return self.now()
        instant = stamp + self._shift
        if instant < self._last:
            self._shift += self._last - instant
            instant = self._last
        self._last = instant
        self._offset = instant - time.monotonic()
        return instant

    def now(self) -> float:
        """The bus time now."""
        return max(self._last, time.monotonic() + self._offset)


class ModuleNode:
    """One module with a bus of its own, which `open_bus` opens and opens again after a failure."""

    def __init__(self, make_module: Callable[[float], AxisModule], open_bus: Callable[[], can.BusABC]):
        self._clock = BusTime()
        self.module = make_module(self._clock.now())
        self._open_bus = open_bus
        self.bus: can.BusABC | None = open_bus()
        self._retry_at = 0.0

    def patience(self) -> float | None:
        """How long the node may sleep if no frame comes, s."""
        if self.bus is None:
            return max(0.0, self._retry_at - time.monotonic())
        if self.module.expires is None:
            return None
        return max(0.0, self.module.expires - self._clock.now())

    def step(self, timeout: float) -> bool:
        """Take one frame, waiting for it at most `timeout` s, and look after the watchdog; false if none came.

        A bus that fails is closed and reported; the axis goes on, and so does its watchdog.
        """
        message = None
        try:
            if self.bus is not None:
                message = self.bus.recv(timeout)
            if message is not None and not message.is_error_frame and not message.is_extended_id:
                at = self._clock.at(message.timestamp)
                if message.arbitration_id == frames.CALL and message.data == frames.WHO:
                    self._send(*frames.encode_identity(self.module.identity), extended=True)
                self._say(self.module.receive(message.arbitration_id, message.data, at))
            elif self.module.expires is not None:
                self._say(self.module.expire(self._clock.now()))
        except (can.CanError, OSError) as error:
            LOG.error("module %s lost its bus: %s; trying again every %g s", self.module.name, error, RETRY)
            self.close()
            self._retry_at = time.monotonic() + RETRY
        return message is not None

    @property
    def number(self) -> int:
        """Its node."""
        return self.module.identity.node

    def press(self, active: bool) -> None:
        """The module's emergency stop button: pressed, it stops this module, which stops all others on its bus.

        can.CanError if the bus fails; this module has stopped even so.
        """
        reports = self.module.set_emergency_input(active, self._clock.now())
        if reports:
            self._send(frames.GENERAL, frames.EMERGENCY)
        self._say(reports)

    def reopen(self) -> bool:
        """Open the bus again if it failed and it is time to; true if it did."""
        if self.bus is not None or time.monotonic() < self._retry_at:
            return False
        try:
            self.bus = self._open_bus()
        except MachineError as error:
            LOG.error("module %s: %s", self.module.name, error)
            self._retry_at = time.monotonic() + RETRY
            return False
        LOG.warning("module %s is back on its bus", self.module.name)
        return True

    def close(self) -> None:
        """Leave the bus."""
        bus, self.bus = self.bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except (can.CanError, OSError) as error:
                LOG.warning("module %s could not close its bus: %s", self.module.name, error)

    def _say(self, answers: list[bytes]) -> None:
        for data in answers:
            self._send(self.module.identifier, data)

    def _send(self, identifier: int, data: bytes, extended: bool = False) -> None:
        if self.bus is not None:
            self.bus.send(can.Message(arbitration_id=identifier, is_extended_id=extended, data=data), _SEND_TIMEOUT)
