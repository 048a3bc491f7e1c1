"""The host's side of the cyclic protocol: one frame out as the tick, one answer of each unit in.

The voltage of a stepper axis is the rate of its pulses, so the controllers of any axis drive it. What such a unit
answers is the position that it was told to take: it has no encoder, and steps that the motor lost are not seen
(dcs-thesis, 5.5).
"""

from __future__ import annotations

import logging
import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from rds.bus.hub.bus_settings import BAUD, DEFAULT_BAUD, SERIAL
from rds.bus.modules import drivers_base
from rds.bus.modules.dcs import frames
from rds.bus.modules.dcs.answers import AnswerStream
from rds.bus.modules.dcs.commands import TURN_ROUND
from rds.bus.modules.dcs.frames import ANSWER_SIZE, Answer, Info, Mode, Status
from rds.bus.modules.dcs.port import Port, SerialPort
from rds.core import contracts
from rds.core.contracts import Watch
from rds.core.errors import InputError, MachineError
from rds.core.shared_quantities import SAMPLE_PERIOD
from rds.machines.machine import Axis, Machine

LOG = logging.getLogger(__name__)

SILENT_AFTER = 10  # periods without an answer; then all axes get zero volts
LOST_AFTER = 0.3  # s without an answer, and SILENT_AFTER periods at least: the run ends
_SET_UPS = 3  # a frame may be damaged, and a unit that has the set-up of an earlier host does not tell
_STARTING = 1.0  # s for all units to answer at the start


@dataclass
class Counters(contracts.Counters):
    """What a serial line shows besides."""

    damaged: int = 0  # answers that came as something else
    watchdogs: int = 0  # answers of units that had stopped by themselves
    cut: int = 0  # periods of zero volts because a unit was silent


class _Unit(drivers_base.Module):
    """A unit of the line."""

    __slots__ = ("number", "unset")

    def __init__(self, axis: Axis):
        super().__init__(f"{axis.name} (unit {axis.node})", axis.resolution, absolute=axis.is_spindle)
        self.number = axis.node
        self.unset = 0  # answers in a row by which it has been reset


class DcsDrivers(drivers_base.DriversBase[_Unit, Answer]):
    """Implements `rds.core.contracts.Drivers` for the `axes` (names; default all) of `machine` on a serial line.

    `channel` is a serial port, or the name of a served machine (default: the machine's own); `port` is one that is
    open already, and stays the caller's. With `dry_run` the units answer and stand.

    InputError where a frame and its answers do not go into a sample period at this baud rate.
    """

    noun = "units"
    counters: Counters

    def __init__(
        self,
        machine: Machine,
        axes: Sequence[str] | None = None,
        *,
        port: Port | None = None,
        interface: str = SERIAL,
        channel: str | None = None,
        baud: float | None = None,
        checksum: bool = True,
        sample_period: float | None = None,
        dry_run: bool = False,
        timeout: float | None = None,
    ):
        names = list(machine.axes)
        if len(names) > frames.SLOTS:
            raise InputError(f"{len(names)} axes; a frame has places for {frames.SLOTS}; serve it on CAN", machine.path)
        if machine.converter.range > frames.HIGHEST_VOLTAGE:
            raise InputError(
                f"its converter gives {machine.converter.range:g} V, and a frame on a serial line carries "
                f"{frames.HIGHEST_VOLTAGE:g} V: serve it on CAN, or say range = 10.0 in [converter]",
                machine.path,
            )
        used = [machine.axis(name) for name in (names if axes is None else axes)]
        self._slots = [names.index(axis.name) for axis in used]
        for axis in used:
            if axis.node not in frames.UNITS:
                raise InputError(f"axis {axis.name} has node {axis.node}; units have 1 to 15", machine.path)
        period = SAMPLE_PERIOD.check(machine.sample_period if sample_period is None else sample_period, "sample_period")
        baud = BAUD.check(DEFAULT_BAUD if baud is None else baud, "baud")
        self._check_time(baud, period, len(names), checksum)
        self._owns_port = port is None
        where = channel if channel is not None else machine.channel
        super().__init__([_Unit(axis) for axis in used], period, timeout, _lost_after(period), f"{SERIAL}:{where}")
        self._port: Port = SerialPort(where, baud) if port is None else port
        self._receive = self._next
        self._help = (
            f"start the machine (rds machine serve {machine.name} --dialect dcs), or check [bus], power and cable"
        )
        self._by_number = {unit.number: unit for unit in self._modules}
        self._mode = Mode.CALL if dry_run else Mode.VOLTAGES
        self._info = Info(self._mode, 0, True, checksum)
        self._setup = frames.setup_body(period, secrets.randbelow(1 << 32))
        self._zero = bytes(frames.SIZE - 1)
        self._waiting = self._zero
        self._waiting_voltages: tuple[float, ...] = (0.0,) * len(used)
        self._sent_voltages = self._waiting_voltages
        self._answers = AnswerStream()

    @staticmethod
    def _check_time(baud: float, period: float, units: int, checksum: bool) -> None:
        time = exchange_time(baud, units, checksum)
        if time > frames.FULL * period:
            raise InputError(
                f"a frame and the answers of {units} units take {time * 1e3:.2f} ms at {baud:g} bit/s, more than "
                f"{frames.FULL:.0%} of the sample period of {period * 1e3:g} ms: raise [bus] baud or the sample period "
                "(`rds bus analyse` tells what fits)"
            )

    def _count_anew(self) -> None:
        self.counters = Counters()

    # --- start

    def _refuse_company(self) -> None:
        """A port has one host; the system refuses a second one."""

    def _set_up(self, watch: Watch) -> None:
        """Tell the period, and check by zero-volt ticks that every unit answers and is set up."""
        self._waiting, self._waiting_voltages = self._zero, (0.0,) * len(self._modules)
        deadline, told = time.monotonic() + _STARTING, 0
        while (silent := [unit for unit in self._modules if not unit.seen]) or told < _SET_UPS:
            if silent and time.monotonic() > deadline:
                raise self._silent(silent)
            told += 1
            for unit in self._modules:
                unit.missed = 0
            self._send(self._info._replace(mode=Mode.SETUP), self._setup)
            time.sleep(self._period)
            self._drain()
            self._paced_exchange()

    # --- the cycle

    def _send(self, info: Info, body: bytes) -> None:
        self._port.write(frames.encode(info, body))

    def _tick(self) -> None:
        self._sent_voltages = self._waiting_voltages
        self._info = self._info._replace(number=(self._info.number + 1) % frames.NUMBERS)
        self._send(self._info, self._waiting)

    def _next(self, timeout: float) -> Answer | None:
        """The next answer on the line, within so many s."""
        deadline = self._port.now() + timeout
        while True:
            answer = self._answers.next()
            self.counters.damaged = self._answers.damaged
            if answer is not None:
                return answer
            left = max(0.0, deadline - self._port.now())
            more = self._port.read(left)
            if not more and self._port.now() >= deadline:
                return None
            self._answers.add(more)

    def _take(self, frame: Answer, late: bool) -> _Unit | None:
        unit = self._by_number.get(frame.unit)
        if unit is None:
            self.counters.foreign += 1
            return None
        unit.unset = unit.unset + 1 if frame.status & Status.NOT_SET_UP else 0
        if unit.unset > 1 and self._started:  # one alone may be noise
            raise MachineError(
                f"{unit} on line {self._bus_name} has been reset in the run; its position is lost: start the run again"
            )
        if late or frame.number != self._info.number:
            self.counters.late += not late  # exchange() counts those that come before the next tick
            return unit if late and unit.seen else None
        if frame.status & Status.NOT_SET_UP:
            return None
        self.counters.watchdogs += bool(frame.status & Status.WATCHDOG)
        unit.counts = frame.counts
        return unit

    def write(self, voltages: Sequence[float]) -> tuple[float, ...]:
        """Take the voltages (V) that the next tick sends; return those of the last tick, which act from it on.

        What is returned is what was sent, in whole units of 20/65536 V. InputError outside ±10 V.
        """
        if len(voltages) != len(self._slots):
            raise InputError(f"{len(voltages)} voltages for {len(self._slots)} axes")
        if any(unit.missed >= SILENT_AFTER for unit in self._modules):
            voltages = (0.0,) * len(self._slots)  # nobody moves by positions that are not known
            self.counters.cut += 1
        command = [0.0] * frames.SLOTS
        for slot, voltage in zip(self._slots, voltages, strict=True):
            command[slot] = voltage
        self._waiting = frames.voltage_words(command)
        sent = frames.decode_words(self._waiting)
        self._waiting_voltages = tuple(sent[slot] * frames.VOLTS_PER_UNIT for slot in self._slots)
        return self._sent_voltages

    def confirm(self) -> None:
        """After the last sample: MachineError if a unit that was silent for its last periods goes on being so."""
        self.write((0.0,) * len(self._slots))
        while any(unit.missed >= SILENT_AFTER for unit in self._modules):
            self.exchange()

    def stop(self) -> None:
        """Zero volts on all axes, now. If the line is cut, the units stop by themselves; the log says so."""
        self._waiting, self._waiting_voltages = self._zero, (0.0,) * len(self._modules)
        try:
            self._tick()
            self.counters.ticks += 1
        except MachineError as error:
            LOG.error("zero volts could not be sent (%s); the units stop by themselves", error)

    def _shut(self) -> None:
        if self._owns_port:
            self._port.close()


def exchange_time(baud: float, units: int, checksum: bool = True) -> float:
    """s that a frame and the answers of so many units take on the wire."""
    byte = frames.byte_time(baud)
    return (frames.SIZE + checksum) * byte + units * (ANSWER_SIZE * byte + TURN_ROUND)


def _lost_after(period: float) -> int:
    return max(SILENT_AFTER, ceil(LOST_AFTER / period))
