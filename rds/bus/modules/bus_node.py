"""What every module has of a bus: its connection, its notion of bus time, and what to do when the bus fails."""

from __future__ import annotations

import logging
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable

import can

from rds.core.errors import MachineError

LOG = logging.getLogger(__name__)

RETRY = 0.5  # s between attempts to open a bus that failed
_SEND_TIMEOUT = 0.1  # s
_AHEAD = 1.0  # s by which a stamp may be ahead of this computer's clock, or behind: clocks drift while nothing comes
Outgoing = tuple[int, bytes, bool]  # identifier, data, extended


class BusNode(ABC):
    """A node on the bus that `open_bus` opens, and opens again after a failure. A dialect says what frames mean.

    A subclass sets up what it serves, for which it has `clock`, then calls `join()`.
    """

    def __init__(self, name: str, open_bus: Callable[[list[int]], can.BusABC]):
        self.name = name
        self.clock = BusTime()
        self.bus: can.BusABC | None = None
        self._open_bus = open_bus
        self._retry_at = 0.0

    # --- what a dialect says

    @property
    @abstractmethod
    def identifiers(self) -> list[int]:
        """What it listens to: standard frames."""

    @property
    @abstractmethod
    def expires(self) -> float | None:
        """The next instant at which something is due, bus time in s; None if nothing is."""

    @abstractmethod
    def receive(self, message: can.Message, at: float) -> Iterable[Outgoing]:
        """Take a frame that came at the instant `at`; the frames to send now."""

    @abstractmethod
    def expire(self, now: float) -> Iterable[Outgoing]:
        """Do what is due; the frames to send now."""

    # --- what is the same for all

    def join(self) -> None:
        """Open the bus. MachineError if that fails."""
        self.bus = self._open_bus(self.identifiers)

    def patience(self) -> float | None:
        """How long the node may sleep if no frame comes, s; None: as long as it likes."""
        expires = self.expires
        instants = [] if expires is None else [expires - self.clock.now()]
        if self.bus is None:
            instants.append(self._retry_at - time.monotonic())
        return max(0.0, min(instants)) if instants else None

    def step(self, timeout: float = 0.0) -> bool:
        """Take one frame, waiting for it at most `timeout` s, or else do what is due; false if no frame came.

        A bus that fails is closed and reported; the axis goes on, and so do its watchdogs.
        """
        message = None
        try:
            if self.bus is not None:
                message = self.bus.recv(timeout)
            if message is not None and not message.is_error_frame:
                self.send(self.receive(message, self.clock.at(message.timestamp)))
            else:
                expires = self.expires
                if expires is not None and expires <= (now := self.clock.now()):
                    self.send(self.expire(now))
        except (can.CanError, OSError) as error:
            LOG.error("module %s lost its bus: %s; trying again every %g s", self.name, error, RETRY)
            self.close()
            self._retry_at = time.monotonic() + RETRY
        return message is not None

    def reopen(self) -> bool:
        """Open the bus again if it failed and it is time to; true if it did."""
        if self.bus is not None or time.monotonic() < self._retry_at:
            return False
        try:
            self.join()
        except MachineError as error:
            LOG.error("module %s: %s", self.name, error)
            self._retry_at = time.monotonic() + RETRY
            return False
        LOG.warning("module %s is back on its bus", self.name)
        return True

    def close(self) -> None:
        """Leave the bus."""
        bus, self.bus = self.bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except (can.CanError, OSError) as error:
                LOG.warning("module %s could not close its bus: %s", self.name, error)

    def send(self, frames: Iterable[Outgoing]) -> None:
        """Send frames, as long as there is a bus. can.CanError if it fails."""
        if self.bus is None:
            return
        for identifier, data, extended in frames:
            message = can.Message(arbitration_id=identifier, is_extended_id=extended, data=data)
            self.bus.send(message, _SEND_TIMEOUT)


class BusTime:
    """Bus time from time stamps: from frame to frame it never goes back, and between goes on by the local clock. In s.

    A stamp's clock may be set (some interfaces stamp with the wall clock); then time goes on from where it was.
    To ask for the time now changes nothing: a frame that is still under way may have been stamped before.
    """

    def __init__(self) -> None:
        self._last = time.time()
        self._shift = 0.0  # bus time less stamp
        self._offset = self._last - time.monotonic()  # bus time less local clock, when the last frame was taken
        self._quickest = self._offset  # the same of the frame that was taken soonest after its stamp

    def at(self, stamp: float) -> float:
        """The bus time of a frame stamped `stamp`, which has just been received; a stamp of 0 means none."""
        if not stamp:
            return self.now()
        local, instant = time.monotonic(), stamp + self._shift
        now = local + self._quickest
        if not self._last <= instant <= now + _AHEAD:
            overtaken = 0.0 < self._last - instant < _AHEAD  # by a frame that was stamped later; else a clock was set
            instant = self._last if overtaken else max(self._last, now)
            self._shift = instant - stamp
        self._last = instant
        self._offset = instant - local
        self._quickest = max(self._quickest, self._offset)
        return instant

    def now(self) -> float:
        """The bus time now."""
        return max(self._last, time.monotonic() + self._offset)
