"""The host's end of a CAN bus in methods A, B and C: a bus of python-can, or modules in virtual time.

Both count what the bus carries by each frame's exact bits.
"""

from __future__ import annotations

import heapq
import time
from collections import deque
from collections.abc import Sequence
from itertools import count
from math import inf
from typing import NamedTuple, Protocol

import can

from rds.bus.medium.bits import INTERFRAME, frame_bits
from rds.bus.modules.rds import motion_frames
from rds.bus.modules.rds.module import AxisModule
from rds.bus.tools.link import bus_failed

_SEND = 0.5  # s for a frame to go out
EXTENDED = 0x800  # identifiers from here on are extended ones


class Frame(NamedTuple):
    """A frame that the host has got."""

    identifier: int
    data: bytes


class MotionPort(Protocol):
    """Frames out, frames in, a clock, and what went over the bus."""

    bits: int  # that went over the bus
    sent_bytes: int  # of the host's frames, data only

    def now(self) -> float:
        """The instant now, s."""

    def sleep(self, until: float) -> None:
        """Wait until that instant; frames that come meanwhile are kept."""

    def send(self, identifier: int, data: bytes) -> None:
        """Send a standard frame. MachineError if the bus fails."""

    def receive(self, timeout: float) -> Frame | None:
        """The next frame, waiting for it at most so many s."""


def bits_of(identifier: int, data: bytes | bytearray) -> int:
    """Bits of a frame on the wire, with the space after it."""
    return frame_bits(identifier, data, extended=identifier >= EXTENDED).nominal + INTERFRAME


class CanPort:
    """A bus of python-can, whose clock is this computer's."""

    def __init__(self, bus: can.BusABC):
        self._bus, self.bits, self.sent_bytes = bus, 0, 0
        self._offset = time.time() - time.monotonic()

    def now(self) -> float:
        """The system's clock, by which the built-in bus stamps its frames, as if nobody had set it since the start."""
        return time.monotonic() + self._offset

    def sleep(self, until: float) -> None:
        """As MotionPort."""
        time.sleep(max(0.0, until - self.now()))

    def send(self, identifier: int, data: bytes) -> None:
        """As MotionPort."""
        try:
            self._bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data), _SEND)
        except (can.CanError, OSError) as error:
            raise bus_failed(self._bus.channel_info, error) from error
        self.bits += bits_of(identifier, data)
        self.sent_bytes += len(data)

    def receive(self, timeout: float) -> Frame | None:
        """As MotionPort; error frames and remote frames are passed over."""
        deadline = time.monotonic() + timeout
        while True:
            try:
                message = self._bus.recv(max(0.0, deadline - time.monotonic()))
            except (can.CanError, OSError) as error:
                raise bus_failed(self._bus.channel_info, error) from error
            if message is None:
                return None
            if message.is_error_frame or message.is_remote_frame:
                continue
            self.bits += bits_of(message.arbitration_id, message.data)
            return Frame(message.arbitration_id, bytes(message.data))


class VirtualCan:
    """Modules on a bus of `bitrate` in virtual time: the lowest identifier goes first, and nothing is lost."""

    def __init__(self, modules: Sequence[AxisModule], bitrate: int):
        self.modules, self.bitrate, self.bits, self.sent_bytes = modules, bitrate, 0, 0
        self._now = self._free = 0.0
        self._numbers = count()
        self._waiting: list[tuple[float, int, int, bytes, bool]] = []  # since, identifier, number, data, of the host
        self._flying: tuple[float, int, bytes, bool] | None = None  # until, identifier, data, of the host
        self._got: deque[Frame] = deque()

    def now(self) -> float:
        """The virtual instant."""
        return self._now

    def sleep(self, until: float) -> None:
        """As MotionPort."""
        self._advance(until)

    def send(self, identifier: int, data: bytes) -> None:
        """As MotionPort."""
        self._offer(self._now, identifier, data, True)
        self.sent_bytes += len(data)

    def receive(self, timeout: float) -> Frame | None:
        """As MotionPort."""
        deadline = self._now + max(0.0, timeout)
        while not self._got and self._now < deadline:
            self._advance(min(self._due(), deadline))
        return self._got.popleft() if self._got else None

    def _offer(self, at: float, identifier: int, data: bytes, of_host: bool) -> None:
        heapq.heappush(self._waiting, (at, identifier, next(self._numbers), data, of_host))

    def _due(self) -> float:
        """The next instant at which a frame is whole, or a module has something to do."""
        return min(self._flying[0] if self._flying else self._start(), self._expiry())

    def _start(self) -> float:
        return max(self._free, self._waiting[0][0]) if self._waiting else inf

    def _expiry(self) -> float:
        return min((expires for module in self.modules if (expires := module.expires) is not None), default=inf)

    def _advance(self, until: float) -> None:
        while (due := self._due()) <= until:
            self._now = max(self._now, due)
            if (expiry := self._expiry()) <= due:
                for module in self.modules:
                    for data in module.expire(expiry):
                        self._offer(expiry, module.identifier, data, False)
            elif self._flying is None:
                self._begin(due)
            else:
                self._deliver()
        self._now = max(self._now, until)

    def _begin(self, at: float) -> None:
        """Arbitration: of all that wait, the lowest identifier."""
        ready = [entry for entry in self._waiting if entry[0] <= at]
        winner = min(ready, key=lambda entry: (entry[1] >= EXTENDED, entry[1], entry[2]))
        self._waiting.remove(winner)
        heapq.heapify(self._waiting)
        _, identifier, _, data, of_host = winner
        bits = bits_of(identifier, data)
        self.bits += bits
        self._flying = (at + bits / self.bitrate, identifier, data, of_host)

    def _deliver(self) -> None:
        assert self._flying is not None
        at, identifier, data, of_host = self._flying
        self._flying, self._free = None, at
        if not of_host:
            self._got.append(Frame(identifier, data))
            return
        for module in self.modules:
            if identifier == motion_frames.CONTROL:
                told = module.control(data, at)
                if told is not None:
                    self._offer(at, *told, False)
            else:
                for answer in module.receive(identifier, data, at):
                    self._offer(at, module.identifier, answer, False)
