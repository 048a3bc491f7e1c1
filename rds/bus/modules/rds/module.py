"""A virtual axis module: amplifier, axis and encoder behind one CAN node. It knows frames and bus time, no bus.

On a tick the module latches its encoder at the frame's time stamp, takes the voltage of its slot (which acts the
axis's delay later), and answers with one frame. Its time is real time: the axis moves on by the bus time that has
passed, however late the module learns of it.

What keeps voltage off the axis: a command acts for two and a half sample periods at most, then the output is zero
volts from exactly that instant until the next command; after `WATCHDOG_PERIODS` the module says so. A command that is
too old, or of a second host (freshness.py), is refused and not answered. Numbered commands act once the module has
been set up, so one that was exchanged or has restarted stands still. The emergency stop is latched until it is reset.
"""

from __future__ import annotations

import logging
import os
import secrets
from math import floor

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Answer, Identity, Kind, Status
from rds.bus.modules.rds.freshness import OLDEST, Freshness, Verdict
from rds.core.errors import InputError, MachineError
from rds.machines.machine import Axis
from rds.models.machine_axis import MachineAxis, MachineParameters

LOG = logging.getLogger(__name__)

WATCHDOG_PERIODS = 10
SPINDLE_UNIT = "rev/min"


class AxisModule:
    """The module of one axis; `slot` is the place of its voltage in a command, `start` the bus time now, s."""

    def __init__(self, axis: Axis, slot: int, sample_period: float, start: float):
        if slot >= frames.SLOTS:
            raise InputError(f"axis {axis.name} is number {slot + 1}; a command carries {frames.SLOTS} voltages")
        self.name = axis.name
        self.identifier = frames.answer_identifier(axis.node)
        self.identity = Identity(axis.node, secrets.randbelow(frames.SERIALS), os.getpid())
        self.motion = MachineAxis(machine_parameters(axis), start, axis.unit == SPINDLE_UNIT)
        self.status = Status.NONE
        self.ticks = 0
        self.emergency = False  # latched
        self.emergency_input = False
        self._slot = slot
        self._resolution = axis.resolution
        self._period = sample_period
        self._freshness = Freshness(sample_period)
        self._is_set_up = False
        self._refused_until = start  # for so long others than the host that commands are not listened to
        self._cuts: float | None = None  # when the last command's voltage ends
        self._expires: float | None = None

    @property
    def expires(self) -> float | None:
        """The next instant at which voltage is cut or the watchdog speaks if no command comes, bus time in s."""
        return self._expires if self._cuts is None else self._cuts

    def receive(self, identifier: int, data: bytes | bytearray, at: float) -> list[bytes]:
        """Take a frame stamped `at` (s); return the data of the frames to answer with.

        A frame that makes no sense changes nothing, and is reported in the log.
        """
        try:
            if identifier in (frames.COMMAND, frames.DRY_COMMAND):
                voltage = frames.decode_voltages(identifier, data)[self._slot]
                return [*self.expire(at), *self._command(identifier, frames.decode_number(data), voltage, at)]
            if identifier == frames.SETUP:
                self._set_up(frames.decode_setup(identifier, data), at)
            elif identifier == frames.CALL and data != frames.WHO:
                if data == frames.RESET:
                    self.reset_emergency()
                return [*self.expire(at), self._report(at)]
            elif identifier == frames.GENERAL and data[:1] == frames.EMERGENCY[:1]:
                return [*self.expire(at), self.latch_emergency(at)]
        except MachineError as error:
            LOG.warning("module %s ignored a frame: %s", self.name, error)
        return []

    def expire(self, now: float) -> list[bytes]:
        """Cut the voltage if the last command's time is over by `now`; return the watchdog's report, if it is due."""
        if self._cuts is not None and now >= self._cuts:
            instant, self._cuts = self._cuts, None
            self.motion.cut(instant)
        if self._expires is None or now < self._expires:
            return []
        instant, self._expires = self._expires, None
        self.motion.cut(instant)
        self.status = Status.WATCHDOG
        LOG.info("module %s: no command for %g s, zero volts", self.name, WATCHDOG_PERIODS * self._period)
        return [self._report(instant)]

    def set_emergency_input(self, active: bool, at: float) -> list[bytes]:
        """The module's emergency stop button; return the report to send. Whoever presses it tells all others."""
        was, self.emergency_input = self.emergency_input, active
        return [self.latch_emergency(at)] if active and not was else []

    def latch_emergency(self, at: float) -> bytes:
        """Zero volts until reset_emergency(); return the report to send."""
        if not self.emergency:
            LOG.warning("module %s: emergency stop, zero volts until it is reset", self.name)
        self.emergency = True
        self.motion.cut(at)
        return self._report(at)

    def reset_emergency(self) -> None:
        """Release the latch of the emergency stop; nothing happens while its button is pressed."""
        if not self.emergency_input:
            self.emergency = False

    def _set_up(self, period: float, at: float) -> None:
        """A host begins. Nobody changes the period of one that commands: the watchdog counts in it."""
        if period != self._period and self._freshness.followed(at):
            self._refuse("a set-up", "of another host", at)
            return
        self._period = period
        self._freshness.restart(period)
        self._is_set_up = True

    def _command(self, identifier: int, number: int, voltage: float, at: float) -> list[bytes]:
        verdict = Verdict.FRESH
        if number:
            verdict = self._freshness.judge(number, at)
        elif self._freshness.followed(at) or at < self._refused_until:
            verdict = Verdict.STRANGE
        if verdict is Verdict.OLD or verdict is Verdict.STRANGE:
            self._refuse("a command", verdict.value, at)
            return []
        dry = identifier == frames.DRY_COMMAND
        status = Status.DRY_RUN if dry else Status.ENABLED
        if number and not self._is_set_up:
            status = Status.NOT_SET_UP
        elif verdict is Verdict.FIRST:
            status &= Status.DRY_RUN
        return [self._tick(voltage if status is Status.ENABLED else 0.0, status, at)]

    def _refuse(self, what: str, why: str, at: float) -> None:
        if at >= self._refused_until:
            LOG.warning("module %s refuses %s %s", self.name, what, why)
        self._refused_until = at + WATCHDOG_PERIODS * self._period

    def _tick(self, voltage: float, status: Status, at: float) -> bytes:
        counts = self._counts(at)
        self.ticks += 1
        self.motion.command(0.0 if self.emergency else voltage, at)
        self.status = status
        self._cuts = at + OLDEST * self._period
        self._expires = at + WATCHDOG_PERIODS * self._period
        return frames.encode_answer(Answer(counts, self._whole_status(at), Kind.ANSWER, self.ticks))

    def _report(self, at: float) -> bytes:
        return frames.encode_answer(Answer(self._counts(at), self._whole_status(at), Kind.REPORT, self.ticks))

    def _whole_status(self, at: float) -> Status:
        status = self.status
        if not self.emergency and at >= self._refused_until:
            return status  # a thousand times a second
        if self.emergency:
            status = status & ~Status.ENABLED | Status.EMERGENCY | Status.FAULT
        return status | Status.REFUSED if at < self._refused_until else status

    def _counts(self, at: float) -> int:
        """What the encoder shows at the instant: the nearest whole count."""
        return floor(self.motion.advance(at) / self._resolution + 0.5)


def machine_parameters(axis: Axis) -> MachineParameters:
    """The axis's [machine] table; where there is none, the machine is what its model says."""
    if axis.machine:
        return MachineParameters.from_table(axis.machine, f"[axis.{axis.name}.machine]")
    table = {key: value for key, value in axis.model.items() if key != "name"}
    return MachineParameters.from_table(table, f"[axis.{axis.name}.model], as there is no [axis.{axis.name}.machine]")
