"""One opened interface for all modules that a process serves: most adapters can be opened once and no more.

Each module has an end of its own, which hears what comes over the bus and what the other modules send, as on a wire.
"""

from __future__ import annotations

import contextlib
import socket
import threading
from collections import deque
from collections.abc import Callable, Sequence
from copy import copy
from typing import Any

import can

from rds.bus.tools.link import BUILTIN, bus_name, open_bus, standard_filters

OPEN_TO_MANY = (BUILTIN, "virtual", "socketcan", "udp_multicast")  # and what one sends reaches the others
_LOOK = 0.1  # s between two looks of the reader at whether it is still needed
_MOST = 4096  # frames that wait for a module


def opener_of(interface: str, channel: str | None, **options: Any) -> Callable[..., can.BusABC]:
    """What opens the bus for each module: `open(identifiers, mask=0x7FF, node="X")`.

    Where an interface can be opened by many, each module opens it; else all share one.
    """
    if interface in OPEN_TO_MANY:

        def open_own(
            identifiers: Sequence[int] | None = None, mask: int = 0x7FF, node: str | None = None
        ) -> can.BusABC:
            return open_bus(interface, channel, identifiers, mask, node=node, **options)

        return open_own
    return SharedInterface(lambda: open_bus(interface, channel, **options), bus_name(interface, channel)).end


class SharedInterface:
    """Opens a bus with the first end, and closes it with the last one."""

    def __init__(self, opener: Callable[[], can.BusABC], name: str):
        self._opener, self._name = opener, name
        self._lock = threading.RLock()
        self._bus: can.BusABC | None = None
        self._ends: list[SharedEnd] = []

    def end(self, identifiers: Sequence[int] | None = None, mask: int = 0x7FF, node: str | None = None) -> can.BusABC:
        """A module's end, which hears standard frames with these identifiers (None: all). MachineError as open_bus."""
        filters = None if identifiers is None else standard_filters(identifiers, mask)
        with self._lock:
            if self._bus is None:
                self._bus = self._opener()
                threading.Thread(target=self._read, args=(self._bus,), name=f"bus {self._name}", daemon=True).start()
            made = SharedEnd(self, filters, f"{self._name} for {node}" if node else self._name)
            self._ends.append(made)
        return made

    def send(self, sender: SharedEnd, message: can.Message, timeout: float | None) -> None:
        """To the bus, then to the other modules."""
        with self._lock:
            if self._bus is None:
                raise can.CanOperationError(f"bus {self._name} is closed")
            self._bus.send(message, timeout)
            heard = copy(message)
            heard.timestamp = 0.0  # none: the adapter's stamps may be of another clock than this computer's
            self._deliver(heard, sender)

    def leave(self, end: SharedEnd) -> None:
        """An end is closed; the last one closes the bus."""
        with self._lock:
            if end in self._ends:
                self._ends.remove(end)
            if not self._ends:
                self._close()

    def _read(self, bus: can.BusABC) -> None:
        while self._bus is bus:
            try:
                message = bus.recv(_LOOK)
            except (can.CanError, OSError, ValueError) as error:
                with self._lock:
                    if self._bus is bus:  # else it was closed under the reader
                        self._fail(error)
                return
            if message is not None:
                with self._lock:
                    self._deliver(message, None)

    def _deliver(self, message: can.Message, sender: SharedEnd | None) -> None:
        for end in self._ends:
            if end is not sender:
                end.take(message)

    def _fail(self, error: Exception) -> None:
        """All ends learn of it; the first one that opens again opens the bus."""
        for end in self._ends:
            end.fail(error)
        self._ends = []
        self._close()

    def _close(self) -> None:
        bus, self._bus = self._bus, None
        if bus is not None:
            with contextlib.suppress(can.CanError, OSError):
                bus.shutdown()


class SharedEnd(can.BusABC):
    """What a module has of a shared interface: a bus of python-can with a descriptor to wait for."""

    def __init__(self, shared: SharedInterface, filters: Any, info: str):
        self._shared = shared
        self._guard = threading.Lock()  # of the frames, the failure, and the byte that tells of them
        self._frames: deque[can.Message] = deque()
        self._failure: Exception | None = None
        self._awake, self._wakes = socket.socketpair()  # a byte, as long as there is a frame or the failure
        self.channel_info = info
        super().__init__(channel=info, can_filters=filters)

    def take(self, message: can.Message) -> None:
        """A frame from the bus or from another module. One more than it can hold is lost, as in a controller."""
        if not self._matches_filters(message):
            return
        with self._guard:
            if not self._frames:
                self._wake()
            if len(self._frames) < _MOST:
                self._frames.append(message)

    def fail(self, error: Exception) -> None:
        """The bus has failed: recv() raises it, after the frames that came before."""
        with self._guard:
            self._failure = error
            if not self._frames:
                self._wake()

    def _wake(self) -> None:
        with contextlib.suppress(OSError):  # it is closed
            self._wakes.send(b"\0")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self._awake.settimeout(timeout)
        try:
            self._awake.recv(1, socket.MSG_PEEK)
        except (TimeoutError, BlockingIOError):
            return None, True
        with self._guard:
            if self._frames:
                message = self._frames.popleft()
                if not self._frames and self._failure is None:
                    self._awake.recv(1)
                return message, True
            if self._failure is not None:
                raise can.CanOperationError(str(self._failure) or type(self._failure).__name__) from self._failure
        return None, True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """To the bus and to the other modules. can.CanError where the bus fails."""
        if self._failure is not None:
            raise can.CanOperationError(str(self._failure) or type(self._failure).__name__)
        self._shared.send(self, msg, timeout)

    def fileno(self) -> int:
        """Readable as long as frames wait."""
        return self._awake.fileno()

    def shutdown(self) -> None:
        """Leave; the last module closes the interface."""
        super().shutdown()
        self._shared.leave(self)
        self._awake.close()
        self._wakes.close()
