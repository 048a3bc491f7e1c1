"""A virtual module on a bus: its connection, bus time, and what to do when the bus fails."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable

import can

from rds.bus.module_node import RETRY, BusTime
from rds.bus.oacs.messages import Frame
from rds.bus.oacs.module import OacsModule
from rds.core.errors import MachineError

LOG = logging.getLogger(__name__)

_SEND_TIMEOUT = 0.1  # s


class OacsNode:
    """One module with a bus of its own; `open_bus` opens it for the module's identifiers, and again after a failure."""

    def __init__(self, make_module: Callable[[float], OacsModule], open_bus: Callable[[list[int]], can.BusABC]):
        self.clock = BusTime()
        self.module = make_module(self.clock.now())
        self._open_bus = open_bus
        self.bus: can.BusABC | None = open_bus(self.module.identifiers)
        self._retry_at = 0.0

    def patience(self) -> float | None:
        """How long the node may sleep if no frame comes, s; None: as long as it likes."""
        instants = [] if self.module.expires is None else [self.module.expires - self.clock.now()]
        if self.bus is None:
            instants.append(self._retry_at - time.monotonic())
        return max(0.0, min(instants)) if instants else None

    def step(self, timeout: float = 0.0) -> bool:
        """Take one frame, waiting for it at most `timeout` s, and do what is due; false if no frame came.

        A bus that fails is closed, reported, and opened again later; the axis goes on, and so do its watchdogs.
        """
        if self.bus is None and time.monotonic() >= self._retry_at:
            self._reopen()
        message = None
        try:
            if self.bus is not None:
                message = self.bus.recv(timeout)
            if message is not None and not message.is_error_frame and not message.is_remote_frame:
                at = self.clock.at(message.timestamp)
                self._say(self.module.receive(message.arbitration_id, message.data, at, message.is_extended_id))
            else:
                self.look()
        except (can.CanError, OSError) as error:
            LOG.error("module %s lost its bus: %s; trying again every %g s", self.module.name, error, RETRY)
            self.close()
            self._retry_at = time.monotonic() + RETRY
        return message is not None

    def look(self) -> None:
        """Do what is due now. can.CanError if the bus fails."""
        expires = self.module.expires
        if expires is not None and expires <= self.clock.now():
            self._say(self.module.expire(self.clock.now()))

    def close(self) -> None:
        """Leave the bus."""
        bus, self.bus = self.bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except (can.CanError, OSError) as error:
                LOG.warning("module %s could not close its bus: %s", self.module.name, error)

    def _reopen(self) -> None:
        try:
            self.bus = self._open_bus(self.module.identifiers)
        except MachineError as error:
            LOG.error("module %s: %s", self.module.name, error)
            self._retry_at = time.monotonic() + RETRY
        else:
            LOG.warning("module %s is back on its bus", self.module.name)

    def _say(self, frames: Iterable[Frame]) -> None:
        if self.bus is None:
            return
        for identifier, data, extended in frames:
            self.bus.send(
                can.Message(arbitration_id=identifier, is_extended_id=extended, data=data), timeout=_SEND_TIMEOUT
            )
