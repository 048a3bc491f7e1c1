"""The host's side of the bus: one tick out, one answer of each module in, through python-can only."""

from __future__ import annotations

import logging
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import can

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.answer_order import AnswerOrder, Place
from rds.bus.modules.rds.frames import Answer, Kind, Status
from rds.bus.modules.rds.identity import WAIT as LISTENING
from rds.bus.modules.rds.identity import listen, refuse_clashes
from rds.bus.tools.link import BUILTIN, bus_name, default_channel, open_bus, standard_filters
from rds.core.errors import InputError, MachineError
from rds.machines.machine import Axis, Machine

LOG = logging.getLogger(__name__)

SILENT_AFTER = 10  # periods in a row without an answer; then all axes get zero volts until it answers again
LOST_AFTER = 0.1  # s without an answer, and SILENT_AFTER periods at least: the run ends. Computers stall for less
_STARTING = 1.0  # s for all modules to answer at the start
_STANDSTILL = 20  # ticks in which no encoder moves until the axes count as standing
_LONGEST_COAST = 3.0  # s until then
_SET_UP_AGAIN = 20  # ticks at the start until a module that was not set up is so again
HOST = "host"  # what the built-in bus calls this node
_RELEASE = "release its button, then `rds estop --reset`, or Release at the top of the page"
_ALARMS = int(Status.EMERGENCY | Status.NOT_SET_UP | Status.REFUSED)  # a plain number: flags cost 1 µs
_HOSTS = (frames.COMMAND, frames.DRY_COMMAND, frames.SETUP)  # what only a host sends


@dataclass
class Counters:
    """What went over the bus beside the expected answers."""

    ticks: int = 0  # sent
    missing: int = 0  # answers that did not come in their period
    silent: int = 0  # periods in which a module gave no answer at all, not even a late one
    late: int = 0  # answers to an earlier tick
    lost_ticks: int = 0  # ticks that a module says it did not hear
    watchdogs: int = 0  # reports that a module's watchdog has cut the voltage
    cut: int = 0  # periods of zero volts because a module was silent
    foreign: int = 0  # frames that no module of ours sent
    refused: int = 0  # answers that tell of a command refused: too old, or of another host


class _Module:
    """What the host knows of one module."""

    __slots__ = ("axis", "counts", "identifier", "missed", "order", "origin")

    def __init__(self, axis: Axis):
        self.axis = axis
        self.identifier = frames.answer_identifier(axis.node)
        self.counts = 0
        self.origin = 0  # counts where the reported position is 0
        self.missed = 0  # periods in a row
        self.order = AnswerOrder()

    def __str__(self) -> str:
        return f"{self.axis.name} (node {self.axis.node})"


class AxisDrivers:
    """Implements `rds.core.contracts.Drivers` for the `axes` (names; default all) of `machine`.

    Takes an open `bus`, which stays the caller's, or opens one: `interface`, `channel` (default on the built-in bus:
    the machine's name) and further `options` for it. Voltages and positions are in the order of `axes`; the slots of
    other axes get 0 V. With `dry_run` the modules answer and apply zero volts. `timeout` is how long exchange() waits
    for the answers, s (default: one sample period).

    Positions are relative to where the axis stood at start(); a spindle's speed is absolute.
    """

    def __init__(
        self,
        machine: Machine,
        axes: Sequence[str] | None = None,
        *,
        bus: can.BusABC | None = None,
        interface: str = BUILTIN,
        channel: str | None = None,
        sample_period: float | None = None,
        dry_run: bool = False,
        timeout: float | None = None,
        **options: Any,
    ):
        names = list(machine.axes)
        used = [machine.axis(name) for name in (names if axes is None else axes)]
        self._modules = [_Module(axis) for axis in used]
        self._by_identifier = {module.identifier: module for module in self._modules}
        self._slots = [names.index(axis.name) for axis in used]
        if max(self._slots, default=0) >= frames.SLOTS:
            raise InputError(f"a command carries the voltages of {', '.join(names[: frames.SLOTS])} only", machine.path)
        self._period = machine.sample_period if sample_period is None else sample_period
        self._setup = frames.encode_setup(self._period)
        self._timeout = self._period if timeout is None else timeout
        self._lost_after = max(SILENT_AFTER, ceil(LOST_AFTER / self._period))
        self._listens_to = [frames.GENERAL, *_HOSTS, *sorted(self._by_identifier)]
        self._owns_bus = bus is None
        if bus is None:
            channel = default_channel(machine, interface, channel)
            bus = open_bus(interface, channel, self._listens_to, node=HOST, **options)
            self._bus_name = bus_name(interface, channel)
        else:
            self._bus_name = bus.channel_info
        self._machine = machine
        self._bus = bus
        self._identifier = frames.DRY_COMMAND if dry_run else frames.COMMAND
        self._started = False
        # commands are numbered by this clock, in half sample periods, from an instant that no two hosts share
        self._number_per_second = 2.0 / self._period
        self._number_origin = secrets.randbelow(frames.NUMBERS)
        self._tick = can.Message(arbitration_id=self._identifier, is_extended_id=False, data=bytes(8))
        self._zero = frames.encode_voltages(())
        self._unheard: set[int] = set()  # identifiers of the modules that have been silent since the last tick
        self._waiting = self._zero  # without its number
        self._waiting_voltages: tuple[float, ...] = (0.0,) * len(used)
        self._sent_voltages = self._waiting_voltages
        self._closed = False
        self.counters = Counters()

    def start(self) -> None:
        """Set the sample period, check by zero-volt ticks that every module answers, and take the origins.

        The axes stand when this returns. Raises MachineError naming the modules that don't answer, both of those that
        share a node, and whose emergency stop is latched; and if another host commands the bus.
        """
        self._started = False
        self._refuse_company()
        self._waiting = self._zero
        self._waiting_voltages = (0.0,) * len(self._modules)
        self._send(frames.SETUP, self._setup)
        deadline = time.monotonic() + _STARTING
        while not all(module.order.seen for module in self._modules):
            if time.monotonic() > deadline:
                raise self._silent([module for module in self._modules if not module.order.seen])
            for module in self._modules:
                module.missed = 0
            try:
                if self.counters.ticks % _SET_UP_AGAIN == _SET_UP_AGAIN - 1:  # a frame may be lost
                    self._send(frames.SETUP, self._setup)
                self.exchange()
            except MachineError as error:
                if isinstance(error.__cause__, can.CanTimeoutError):  # with bit timing: nobody acknowledges the ticks
                    raise self._silent([module for module in self._modules if not module.order.seen]) from error
                raise
        self._wait_for_standstill()
        for module in self._modules:
            module.origin = 0 if module.axis.unit == "rev/min" else module.counts
        self.counters = Counters()
        self._started = True

    @property
    def standing(self) -> list[float]:
        """Where the axes stood at start() by their modules' own counters, in axis units: the zero of exchange()."""
        return [((m.origin + 0x80000000) % 0x100000000 - 0x80000000) * m.axis.resolution for m in self._modules]

    def _refuse_company(self) -> None:
        """MachineError if two modules share a node, or another host commands. A filtered bus hides both."""
        if self._owns_bus:
            self._bus.set_filters(None)
        heard = listen(self._bus)
        if self._owns_bus:
            self._bus.set_filters(standard_filters(self._listens_to))
        refuse_clashes(heard.modules)
        if heard.commands:
            raise MachineError(self._company(f"{heard.commands} commands in {LISTENING:g} s"))

    def _company(self, what: str) -> str:
        return (
            f"another host commands the modules on bus {self._bus_name} ({what}); stop one of them (`rds estop` stops "
            "the machine): two hosts never drive the same axes"
        )

    def _wait_for_standstill(self) -> None:
        """An earlier run may have left an axis coasting."""
        still, before = 0, [module.counts for module in self._modules]
        deadline = time.monotonic() + _LONGEST_COAST
        while still < _STANDSTILL and time.monotonic() < deadline:
            due = time.monotonic() + self._period
            self.exchange()
            now = [module.counts for module in self._modules]
            still = still + 1 if now == before else 0
            before = now
            time.sleep(max(0.0, due - time.monotonic()))

    def exchange(self) -> list[float]:
        """Send the waiting voltages as the tick; return the measured positions at the tick, in axis units.

        An answer that doesn't come in time repeats the last position and is counted. While a module has not answered
        for 10 periods in a row, all axes get zero volts. Raises MachineError when that lasts 0.1 s, or the bus fails.
        """
        deadline = time.monotonic() + self._timeout
        tick = self._tick
        self._sent_voltages = self._waiting_voltages
        try:
            self._take_stragglers()
            self.counters.silent += bool(self._unheard)
            self._unheard.clear()
            tick.data[:] = frames.number_voltages(self._waiting, self._number())
            self._bus.send(tick, self._timeout * SILENT_AFTER)
            self._count_tick()
            self._collect(deadline)
        except can.CanError as error:
            raise MachineError(f"bus {self._bus_name} failed: {error}") from error
        return [
            ((m.counts - m.origin + 0x80000000) % 0x100000000 - 0x80000000) * m.axis.resolution for m in self._modules
        ]

    def _number(self) -> int:
        """The number of a command that is sent now."""
        return 1 + (int(time.monotonic() * self._number_per_second) + self._number_origin) % frames.NUMBERS

    def _count_tick(self) -> None:
        self.counters.ticks += 1
        for module in self._modules:
            module.order.tick()

    def _take_stragglers(self) -> None:
        """What has come before this tick is sent does not answer it.

        So a module whose answers were late for a while is not taken for one that lost a tick, and its answers for
        ever for those to the tick before.
        """
        receive, modules = self._bus.recv, self._by_identifier
        while (message := receive(0.0)) is not None:
            module = modules.get(message.arbitration_id)
            if module is None or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
                self._take_foreign(message)
                continue
            answer = frames.decode_answer(message.arbitration_id, message.data)
            if answer.status & _ALARMS:
                self._heed(module, answer)
            if answer.kind != Kind.ANSWER:
                self.counters.watchdogs += bool(answer.status & Status.WATCHDOG)
            elif module.order.seen:
                self._unheard.discard(module.identifier)
                self.counters.late += 1
                if self._place(module, answer) is not Place.ASTRAY:
                    self._count_lost(module.order.straggler(answer))

    def _collect(self, deadline: float) -> None:
        """Take answers until all are here or the deadline has passed."""
        receive, modules, clock = self._bus.recv, self._by_identifier, time.monotonic
        awaited = set(modules)
        doubtful: dict[int, Answer] = {}
        while awaited:
            left = deadline - clock()
            message = receive(left if left > 0.0 else 0.0)
            if message is None:
                if left <= 0.0 or clock() >= deadline:
                    break
                continue
            module = modules.get(message.arbitration_id)
            if module is None or message.is_extended_id or message.is_error_frame or message.is_remote_frame:
                self._take_foreign(message)
                continue
            answer = frames.decode_answer(message.arbitration_id, message.data)
            if answer.status & _ALARMS:
                self._heed(module, answer)
            if answer.kind != Kind.ANSWER:
                self.counters.watchdogs += bool(answer.status & Status.WATCHDOG)
            else:
                place = self._place(module, answer)
                if place is Place.LAST:
                    self._count_lost(module.order.take(answer))
                    module.counts = answer.counts
                    module.missed = 0
                    awaited.discard(module.identifier)
                    continue
                self.counters.late += 1
                if place is Place.EARLIER:
                    doubtful[module.identifier] = answer
        if awaited:
            self._note_missing(awaited, doubtful)

    def _take_foreign(self, message: can.Message) -> None:
        """A frame that no module of ours sent. MachineError for an emergency stop, and for another host."""
        self.counters.foreign += 1
        if message.is_extended_id or message.is_error_frame or message.is_remote_frame or not message.is_rx:
            return
        if message.arbitration_id == frames.GENERAL and message.data[:1] == frames.EMERGENCY[:1]:
            raise MachineError(f"emergency stop: called on bus {self._bus_name} from outside this run; {_RELEASE}")
        if message.arbitration_id in _HOSTS:
            raise MachineError(self._company(f"frame {message.arbitration_id:#05x} was heard"))

    def _heed(self, module: _Module, answer: Answer) -> None:
        """What a module says beside its position. MachineError if it has stopped, or is another than at the start."""
        if answer.status & Status.EMERGENCY:
            raise MachineError(f"emergency stop of {module}; {_RELEASE}")
        if answer.status & Status.NOT_SET_UP and self._started:
            raise self._replaced(module)
        self.counters.refused += bool(answer.status & Status.REFUSED)

    def _place(self, module: _Module, answer: Answer) -> Place:
        """Where the answer stands among those of its module. MachineError if they are another module's."""
        place = module.order.place(answer)
        if place is not Place.ASTRAY:
            return place
        if not self._started:
            return Place.LAST
        if module.order.is_another():
            raise self._replaced(module)
        return place

    def _replaced(self, module: _Module) -> MachineError:
        return MachineError(
            f"{module} on bus {self._bus_name} has restarted, or was replaced by another, in the run; its position "
            "is lost: start the run again"
        )

    def _count_lost(self, ticks: int) -> None:
        if ticks:
            self.counters.lost_ticks = max(0, self.counters.lost_ticks + ticks)

    def _note_missing(self, awaited: set[int], doubtful: dict[int, Answer]) -> None:
        lost = []
        for identifier in awaited:
            module = self._by_identifier[identifier]
            if identifier in doubtful:
                # either the module is slow, and its next answer sets the count right, or it lost a tick, and this is
                # its answer. Either way it lives.
                module.order.take_for_want_of_better(doubtful[identifier])
                module.counts = doubtful[identifier].counts
                module.missed = 0
            else:
                self._unheard.add(identifier)
                module.order.owed += 1
                module.missed += 1
            self.counters.missing += 1
            if module.missed >= self._lost_after and module.order.seen:
                lost.append(module)
        for module in lost:
            if module.order.is_another(silent=True):
                raise self._replaced(module)
        if lost:
            raise self._silent(lost)

    def write(self, voltages: Sequence[float]) -> tuple[float, ...]:
        """Take the voltages (V) that the next tick sends; return those of the last tick, which act from it on.

        What is returned is what was sent, in whole units of 20/16384 V. InputError outside ±10 V.
        """
        if len(voltages) != len(self._slots):
            raise InputError(f"{len(voltages)} voltages for {len(self._slots)} axes")
        if any(module.missed >= SILENT_AFTER for module in self._modules):
            voltages = (0.0,) * len(self._slots)  # nobody moves by positions that are not known
            self.counters.cut += 1
        command = [0.0] * frames.SLOTS
        for slot, voltage in zip(self._slots, voltages, strict=True):
            command[slot] = voltage
        self._waiting = frames.encode_voltages(command)
        sent = frames.decode_voltages(self._identifier, self._waiting)
        self._waiting_voltages = tuple(sent[slot] for slot in self._slots)
        return self._sent_voltages

    def confirm(self) -> None:
        """After the last sample: MachineError if a module that was silent for its last 10 periods goes on being so.

        A module that died less than 0.1 s before the end has not ended the run. Zero volts meanwhile.
        """
        self.write((0.0,) * len(self._slots))
        while any(module.missed >= SILENT_AFTER for module in self._modules):
            self.exchange()

    def stop(self) -> None:
        """Zero volts on all axes, now. If the bus is broken, the modules' watchdogs do it; the log says so."""
        self._waiting = self._zero
        self._waiting_voltages = (0.0,) * len(self._modules)
        try:
            self._send(self._identifier, frames.number_voltages(self._zero, self._number()))
            self._sent_voltages = self._waiting_voltages
            self._count_tick()
            for module in self._modules:
                module.order.owed += 1
        except MachineError as error:
            LOG.error("zero volts could not be sent (%s); the modules' watchdogs cut the voltage", error)

    def close(self) -> None:
        """Zero volts, then let go of the bus (a bus that was handed in stays open)."""
        if self._closed:
            return
        self._closed = True
        self.stop()
        if self._owns_bus:
            self._bus.shutdown()

    def _send(self, identifier: int, data: bytes) -> None:
        try:
            self._bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data), 0.5)
        except (can.CanError, OSError) as error:
            raise MachineError(f"bus {self._bus_name} failed: {error}") from error

    def _silent(self, modules: Sequence[_Module]) -> MachineError:
        names = ", ".join(map(str, modules))
        return MachineError(
            f"no answer from {names} on bus {self._bus_name}; start the machine (rds machine serve "
            f"{self._machine.name}), or check [bus], power and cable"
        )
