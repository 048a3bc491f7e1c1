"""The host's side of the cyclic frames: one command out as the tick, one answer of each module in.

Before the tick of a machine with more than four axes goes a frame with the voltages of the others.
"""

from __future__ import annotations

import logging
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import Any

import can

from rds.bus.modules import drivers_base
from rds.bus.modules.can_drivers import CanDrivers, Handler
from rds.bus.modules.rds import frames
from rds.bus.modules.rds.answer_order import AnswerOrder, AnswerPosition
from rds.bus.modules.rds.frames import Answer, Kind, Status
from rds.bus.modules.rds.identity import WAIT as LISTENING
from rds.bus.modules.rds.identity import listen, refuse_clashes, refuse_others
from rds.bus.tools.link import BUILTIN, standard_filters
from rds.core import contracts
from rds.core.contracts import Watch
from rds.core.errors import InputError, MachineError
from rds.machines.machine import Axis, Machine

LOG = logging.getLogger(__name__)

SILENT_AFTER = 10  # periods in a row without an answer; then all axes get zero volts until it answers again
LOST_AFTER = 0.1  # s without an answer, and SILENT_AFTER periods at least: the run ends. Computers stall for less
_STARTING = 1.0  # s for all modules to answer at the start
_SET_UP_AGAIN = 20  # ticks at the start, a quarter of it at most, until a module that was not set up is so again
_SET_UPS = 3  # at the start: a frame may be lost, and a module that has a set-up already does not tell
_IGNORED = 10  # commands in a row: the first one after a silence is not taken
_SET_UP_TRIES, _SET_UP_TICKS = 3, 5  # for a module that takes no commands, though it answers
_RELEASE = "release its button, then `rds estop --reset`, or Release at the top of the page"
_OBEYS = int(Status.ENABLED | Status.DRY_RUN)
_ALARMS = int(Status.EMERGENCY | Status.NOT_SET_UP | Status.REFUSED)  # a plain number: flags cost 1 µs


@dataclass
class Counters(contracts.Counters):
    """What these modules tell besides."""

    lost_ticks: int = 0  # ticks that a module says it did not hear
    watchdogs: int = 0  # reports that a module's watchdog has cut the voltage
    cut: int = 0  # periods of zero volts because a module was silent
    refused: int = 0  # answers that tell of a command refused: too old, or of another host


class _Module(drivers_base.Module):
    """A module of the cyclic frames, and the order of its answers."""

    __slots__ = ("axis", "doubtful", "ignored", "order")

    def __init__(self, axis: Axis):
        super().__init__(f"{axis.name} (node {axis.node})", axis.resolution, absolute=axis.unit == "rev/min")
        self.axis = axis
        self.order = AnswerOrder()
        self.ignored = 0  # commands in a row that it has answered and not taken, at the start
        self.doubtful: Answer | None = None  # since the last tick: to a tick before, or to this one after a lost one


class AxisDrivers(CanDrivers[_Module]):
    """Implements `rds.core.contracts.Drivers` for the `axes` (names; default all) of `machine`.

    Takes an open `bus`, which stays the caller's, or opens one: `interface`, `channel` (default on the built-in bus:
    the machine's name) and further `options` for it. Voltages and positions are in the order of `axes`; the slots of
    other axes get 0 V. With `dry_run` the modules answer and apply zero volts. `timeout` is how long exchange() waits
    for the answers, s (default: one sample period).

    Positions are relative to where the axis stood at start(); a spindle's speed is absolute. While a module has not
    answered for 10 periods in a row, all axes get zero volts; when that lasts 0.1 s, exchange() raises MachineError.
    """

    counters: Counters

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
        self._slots = [machine.slots[axis.name] for axis in used]
        self._range = machine.converter.range  # V
        self._scale = self._range / frames.HIGHEST_VOLTAGE
        if len(names) > frames.MOST_AXES:
            raise InputError(f"{len(names)} axes; commands carry {frames.MOST_AXES} voltages", machine.path)
        period = machine.sample_period if sample_period is None else sample_period
        self._setup = frames.encode_setup(period)
        modules = [_Module(axis) for axis in used]
        handlers: dict[int, Handler[_Module]] = {
            frames.answer_identifier(axis.node): partial(self._take_answer, module)
            for axis, module in zip(used, modules, strict=True)
        }
        if any(axis.module.get("load_cell") for axis in used):
            handlers[frames.FORCE] = self._take_force
        super().__init__(
            machine,
            modules,
            handlers,
            hosts=(frames.COMMAND, frames.DRY_COMMAND, frames.SETUP, frames.MORE_VOLTAGES),
            also=(frames.GENERAL,),
            bus=bus,
            interface=interface,
            channel=channel,
            options=options,
            period=period,
            timeout=timeout,
            lost_after=max(SILENT_AFTER, ceil(LOST_AFTER / period)),
        )
        self._help = f"start the machine (rds machine serve {machine.name}), or check [bus], power and cable"
        self._identifier = frames.DRY_COMMAND if dry_run else frames.COMMAND
        # commands are numbered by this clock, in half sample periods, from an instant that no two hosts share
        self._number_per_second = 2.0 / period
        self._number_origin = secrets.randbelow(frames.NUMBERS)
        self._frame = can.Message(arbitration_id=self._identifier, is_extended_id=False, data=bytes(8))
        self._more = None
        if max(machine.slots.values()) >= frames.SLOTS:
            self._more = can.Message(arbitration_id=frames.MORE_VOLTAGES, is_extended_id=False, data=bytes(8))
        self._zero = frames.encode_voltages(())
        self._waiting = self._waiting_more = self._zero  # without their number
        self._waiting_voltages: tuple[float, ...] = (0.0,) * len(used)
        self._sent_voltages = self._waiting_voltages

    def _count_anew(self) -> None:
        self.counters = Counters()

    # --- start

    def _refuse_company(self) -> None:
        """A filtered bus hides both modules that share a node, and another host."""
        if self._owns_bus:
            self._bus.set_filters(None)
        heard = listen(self._bus)
        if self._owns_bus:
            self._bus.set_filters(standard_filters(self._listens_to))
        refuse_clashes(heard.modules)
        refuse_others(heard.modules, [module.axis for module in self._modules], self._range)
        if heard.commands:
            raise self._company(f"{heard.commands} commands in {LISTENING:g} s")

    def _set_up(self, watch: Watch) -> None:
        """Set the sample period, and check by zero-volt ticks that every module answers."""
        self._waiting = self._waiting_more = self._zero
        self._waiting_voltages = (0.0,) * len(self._modules)
        for module in self._modules:
            module.ignored = 0
        self._send(frames.SETUP, self._setup)
        deadline = time.monotonic() + _STARTING
        again = min(_SET_UP_AGAIN, ceil(0.25 * _STARTING / self._period))
        while silent := [module for module in self._modules if not module.seen]:
            if time.monotonic() > deadline:
                raise self._silent(silent)
            for module in self._modules:
                module.missed = 0
            try:
                if self.counters.ticks % again == again - 1:  # a frame may be lost
                    self._send(frames.SETUP, self._setup)
                self.exchange()
            except MachineError as error:
                if isinstance(error.__cause__, can.CanTimeoutError):  # with bit timing: nobody acknowledges the ticks
                    raise self._silent([module for module in self._modules if not module.seen]) from error
                raise
        for _ in range(_SET_UPS - 1):  # by that of an earlier host, a module might cut the voltage too late
            self._send(frames.SETUP, self._setup)
            self.exchange()

    def _wait_for_standstill(self) -> None:
        """As DriversBase. One that did not get the set-up, and has one of an earlier host, gets it now."""
        super()._wait_for_standstill()
        most = min(_IGNORED, ceil(1.0 / self._period))
        for _ in range(_SET_UP_TRIES):
            if not (deaf := [module for module in self._modules if module.ignored >= most]):
                return
            self._send(frames.SETUP, self._setup)
            for _ in range(_SET_UP_TICKS):
                self._paced_exchange()
        raise MachineError(
            f"{', '.join(map(str, deaf))} on bus {self._bus_name} answers, and takes no command of a sample period of "
            f"{self._period:g} s; switch it off and on, then start again"
        )

    # --- the cycle

    def _tick(self) -> None:
        self._sent_voltages = self._waiting_voltages
        number = self._number()
        if self._more is not None:
            self._more.data[:] = frames.number_voltages(self._waiting_more, number)
            self._bus.send(self._more, self._timeout * SILENT_AFTER)
        self._frame.data[:] = frames.number_voltages(self._waiting, number)
        self._bus.send(self._frame, self._timeout * SILENT_AFTER)
        for module in self._modules:
            module.order.tick()
            module.doubtful = None

    def _number(self) -> int:
        """The number of a command that is sent now."""
        return 1 + (int(time.monotonic() * self._number_per_second) + self._number_origin) % frames.NUMBERS

    def _take_answer(self, module: _Module, message: can.Message, late: bool) -> _Module | None:
        """As DriversBase._take. MachineError if the module has stopped, or is another than at the start."""
        answer = frames.decode_answer(message.arbitration_id, message.data)
        if answer.status & _ALARMS and not self._take_alarm(module, answer):
            return None
        if answer.kind != Kind.ANSWER:
            self.counters.watchdogs += bool(answer.status & Status.WATCHDOG)
            return None
        if late:
            if not module.seen:
                return None
            if self._place(module, answer) is not AnswerPosition.ASTRAY:
                self._count_lost(module.order.straggler(answer))
            return module
        place = self._place(module, answer)
        if place is AnswerPosition.LAST:
            if not self._started:
                module.ignored = 0 if answer.status & _OBEYS else module.ignored + 1
            self._count_lost(module.order.take(answer))
            module.counts = answer.counts
            return module
        self.counters.late += 1
        if place is AnswerPosition.EARLIER:
            module.doubtful = answer
        return None

    def _take_force(self, message: can.Message, late: bool) -> None:
        """What the load cell says; MachineError for what is no force."""
        self.force = frames.decode_force(message.data)

    def _take_alarm(self, module: _Module, answer: Answer) -> bool:
        """What a module says besides its position; whether that counts, for it is set up."""
        if answer.status & Status.EMERGENCY:
            raise MachineError(f"emergency stop of {module}; {_RELEASE}")
        if answer.status & Status.NOT_SET_UP:
            if self._started:
                raise self._replaced(module)
            return False
        self.counters.refused += bool(answer.status & Status.REFUSED)
        return True

    def _place(self, module: _Module, answer: Answer) -> AnswerPosition:
        """Where the answer stands among those of its module. MachineError if they are another module's."""
        place = module.order.place(answer)
        if place is not AnswerPosition.ASTRAY:
            return place
        if not self._started:
            return AnswerPosition.LAST
        if module.order.is_another():
            raise self._replaced(module)
        return place

    def _count_lost(self, ticks: int) -> None:
        if ticks:
            self.counters.lost_ticks = max(0, self.counters.lost_ticks + ticks)

    def _has_substitute(self, module: _Module) -> bool:
        """An answer to another tick shows that the module lives: it is slow, or it lost a tick and this is its answer.

        Its next answer tells which, and sets the count right.
        """
        if module.doubtful is None:
            module.order.owed += 1
            return False
        module.order.take_doubtful(module.doubtful)
        module.counts = module.doubtful.counts
        return True

    def _lost(self, modules: Sequence[_Module]) -> MachineError:
        replaced = next((module for module in modules if module.order.is_another(silent=True)), None)
        return self._silent(modules) if replaced is None else self._replaced(replaced)

    def _hear_foreign(self, identifier: int, data: bytearray) -> None:
        if identifier == frames.GENERAL and data[:1] == frames.EMERGENCY[:1]:
            raise MachineError(f"emergency stop: called on bus {self._bus_name} from outside this run; {_RELEASE}")

    def _replaced(self, module: _Module) -> MachineError:
        return MachineError(
            f"{module} on bus {self._bus_name} has restarted, or was replaced by another, in the run; its position "
            "is lost: start the run again"
        )

    def write(self, voltages: Sequence[float]) -> tuple[float, ...]:
        """Take the voltages (V) that the next tick sends; return those of the last tick, which act from it on.

        What is returned is what was sent, in whole units of 1/8192 of the converter's range. InputError outside it.
        """
        if len(voltages) != len(self._slots):
            raise InputError(f"{len(voltages)} voltages for {len(self._slots)} axes")
        if any(module.missed >= SILENT_AFTER for module in self._modules):
            voltages = (0.0,) * len(self._slots)  # nobody moves by positions that are not known
            self.counters.cut += 1
        command = [0.0] * (frames.SLOTS if self._more is None else frames.MOST_AXES)
        limit, highest, scale = self._range, frames.HIGHEST_VOLTAGE, self._scale
        for slot, voltage in zip(self._slots, voltages, strict=True):
            if not -limit <= voltage <= limit:  # false for NaN too
                raise InputError(
                    f"voltage {voltage!r} V of slot {slot} must be from -{limit:g} to {limit:g} V; limit it before"
                )
            command[slot] = max(-highest, min(highest, voltage / scale))  # the quotient's last bit may be beyond
        self._waiting = frames.encode_voltages(command[: frames.SLOTS])
        sent = frames.decode_voltages(self._identifier, self._waiting)
        if self._more is not None:
            self._waiting_more = frames.encode_voltages(command[frames.SLOTS :])
            sent += frames.decode_voltages(frames.MORE_VOLTAGES, self._waiting_more)
        self._waiting_voltages = tuple(self._scale * sent[slot] for slot in self._slots)
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
        self._waiting = self._waiting_more = self._zero
        self._waiting_voltages = (0.0,) * len(self._modules)
        try:
            number = self._number()
            if self._more is not None:
                self._send(frames.MORE_VOLTAGES, frames.number_voltages(self._zero, number))
            self._send(self._identifier, frames.number_voltages(self._zero, number))
            self._sent_voltages = self._waiting_voltages
            self.counters.ticks += 1
            for module in self._modules:
                module.order.tick()
                module.order.owed += 1
        except MachineError as error:
            LOG.error("zero volts could not be sent (%s); the modules' watchdogs cut the voltage", error)
