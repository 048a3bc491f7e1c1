"""Drivers on a CAN bus, through python-can only: opening it, which frames are whose, and other hosts on it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import can

from rds.bus.modules.drivers_base import DriversBase, M
from rds.bus.tools.adapter import AdapterFailure
from rds.bus.tools.link import bus_name, default_channel, open_bus
from rds.core.errors import AdapterError, MachineError
from rds.machines.machine import Machine

HOST = "host"  # what the built-in bus calls this node
Handler = Callable[[can.Message, bool], M | None]  # as DriversBase._take


class CanDrivers(DriversBase[M, can.Message]):
    """`DriversBase` over an open `bus`, which stays the caller's, or over one that is opened here.

    `handlers` tells for each identifier who takes its frames; `hosts` are the identifiers that only a host sends, and
    `also` others that are to be heard.
    """

    failures = (can.CanError, OSError)

    def __init__(
        self,
        machine: Machine,
        modules: Sequence[M],
        handlers: dict[int, Handler[M]],
        *,
        hosts: Iterable[int],
        also: Sequence[int] = (),
        bus: can.BusABC | None,
        interface: str,
        channel: str | None,
        options: dict[str, Any],
        period: float,
        timeout: float | None,
        lost_after: int,
    ):
        self._handlers, self._handler = handlers, handlers.get
        self._hosts = frozenset(hosts)
        self._listens_to = sorted({*handlers, *self._hosts, *also})
        self._owns_bus = bus is None
        if bus is None:
            channel = default_channel(machine, interface, channel)
            bus = open_bus(interface, channel, self._listens_to, node=HOST, **options)
            name = bus_name(interface, channel)
        else:
            name = bus.channel_info
        self._bus = bus
        self._receive = bus.recv
        super().__init__(modules, period, timeout, lost_after, name)

    @abstractmethod
    def _hear_foreign(self, identifier: int, data: bytearray) -> None:
        """A frame that neither a module of ours nor a host sent. MachineError if it ends the run."""

    def _take(self, frame: can.Message, late: bool) -> M | None:
        handler = self._handler(frame.arbitration_id)
        if handler is None or frame.is_extended_id or frame.is_error_frame or frame.is_remote_frame:
            self._take_foreign(frame)
            return None
        return handler(frame, late)

    def _take_foreign(self, frame: can.Message) -> None:
        """A frame that no module of ours sent. MachineError for an emergency stop, and for another host."""
        self.counters.foreign += 1
        if frame.is_extended_id or frame.is_error_frame or frame.is_remote_frame or not frame.is_rx:
            return
        if frame.arbitration_id in self._hosts:
            self._leave_to_other_host()
            raise self._company(f"frame {frame.arbitration_id:#05x} was heard")
        self._hear_foreign(frame.arbitration_id, frame.data)

    def _leave_to_other_host(self) -> None:
        """Before the run ends because another host commands the bus."""

    def _send(self, identifier: int, data: bytes) -> None:
        try:
            self._bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data), 0.5)
        except self.failures as error:
            raise self._failed(error) from error

    def _failed(self, error: Exception) -> MachineError:
        """An adapter that fails has an error of its own."""
        return AdapterError(str(error)) if isinstance(error, AdapterFailure) else super()._failed(error)

    def _shut(self) -> None:
        if self._owns_bus:
            self._bus.shutdown()
