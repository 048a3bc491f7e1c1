"""A virtual axis module: amplifier, axis and encoder behind one CAN node. It knows frames and bus time, no bus.

On a tick the module latches its encoder at the frame's time stamp, takes the voltage of its slot (which acts the
axis's delay later), and answers with one frame. Its time is real time: the axis moves on by the bus time that has
passed, however late the module learns of it. A module of axes 5 to 8 keeps the voltage of frame 0x00F for the tick
with the same number, which is the next frame.

What keeps voltage off the axis: a command acts for two and a half sample periods at most, then the output is zero
volts from exactly that instant until the next command; after `WATCHDOG_PERIODS` the module says so. A command that is
too old, or of a second host (freshness.py), is refused and not answered. Numbered commands act once the module has
been set up, so one that was exchanged or has restarted stands still. The emergency stop is latched until it is reset.

By methods A, B and C the module closes its position loop itself (node_motion.py). While it does, it takes no voltages;
while a host commands voltages or a motion has set points left, it begins no such motion.
"""

from __future__ import annotations

import logging
import os
import secrets
import struct
from collections.abc import Callable
from math import floor, inf

from rds.bus.modules.rds import frames, motion_frames
from rds.bus.modules.rds.frames import Answer, Identity, Kind, Status
from rds.bus.modules.rds.freshness import OLDEST, Freshness, Verdict
from rds.bus.modules.rds.motion_frames import MotionStatus, Verb
from rds.bus.modules.rds.node_motion import NodeMotion
from rds.core.errors import InputError, MachineError
from rds.core.types import SPINDLE_UNIT
from rds.machines.machine import Axis
from rds.models.machine_axis import MachineAxis, MachineParameters

LOG = logging.getLogger(__name__)

WATCHDOG_PERIODS = 10


class AxisModule:
    """The module of one axis; `slot` is the place of its voltage in a command, `start` the bus time now, s.

    `drift` is how much too fast its clock goes (1e-6: 1 ppm), by default as its machine file says. A command's 10 V are
    the converter's `range`, V.
    """

    def __init__(
        self,
        axis: Axis,
        slot: int,
        sample_period: float,
        start: float,
        drift: float | None = None,
        range: float = frames.HIGHEST_VOLTAGE,
    ):
        if slot >= frames.MOST_AXES:
            raise InputError(f"axis {axis.name} is number {slot + 1}; commands carry {frames.MOST_AXES} voltages")
        self.name = axis.name
        self.node = axis.node
        self.identifier = frames.answer_identifier(axis.node)
        scale = frames.scale(axis.unit, axis.resolution, range)
        self.identity = Identity(axis.node, secrets.randbelow(frames.SERIALS), os.getpid(), scale=scale)
        turns = axis.unit == SPINDLE_UNIT
        self.motion = MachineAxis(machine_parameters(axis), start, turns)
        self.drift = float(axis.module.get("drift", 0.0)) * 1e-6 if drift is None else drift
        self.by_itself = NodeMotion(axis.name, self.motion, axis.resolution, range, self.drift, turns)
        self.cell: Callable[[], float] | None = None  # what its load cell measures now, N
        self.status = Status.NONE
        self.ticks = 0
        self.emergency = False  # latched
        self.emergency_input = False
        self._frame, self._slot = divmod(slot, frames.SLOTS)
        self._before: tuple[int, float, float] | None = None  # number, voltage and instant of the last frame 0x00F
        self._resolution = axis.resolution
        self._scale = range / frames.HIGHEST_VOLTAGE
        self._period = sample_period
        self._freshness = Freshness(sample_period)
        self._is_set_up = False
        self._refused_until = start  # for so long others than the host that commands are not listened to
        self._cuts: float | None = None  # when the last command's voltage ends
        self._expires: float | None = None

    @property
    def hears(self) -> list[int]:
        """The identifiers of the cyclic exchange that mean something to it."""
        more = [frames.MORE_VOLTAGES] if self._frame else []
        own = [motion_frames.SETPOINTS, motion_frames.CONTROL, motion_frames.DATA]
        return [frames.COMMAND, frames.DRY_COMMAND, frames.SETUP, frames.CALL, *more, *own]

    @property
    def expires(self) -> float | None:
        """The next instant at which voltage is cut, the watchdog speaks or a step is due, bus time in s."""
        due = self._expires if self._cuts is None else self._cuts
        by_itself = self.by_itself.expires
        return due if by_itself == inf or (due is not None and due <= by_itself) else by_itself

    def receive(self, identifier: int, data: bytes | bytearray, at: float) -> list[bytes]:
        """Take a frame stamped `at` (s); return the data of the frames to answer with.

        A frame that makes no sense changes nothing, and is reported in the log.
        """
        try:
            if self.by_itself.active:
                self.by_itself.expire(at)
            if identifier in (frames.COMMAND, frames.DRY_COMMAND):
                voltages, number = frames.decode_voltages(identifier, data), frames.decode_number(data)
                voltage = self._told_before(number, at) if self._frame else voltages[self._slot]
                return [*self.expire(at), *self._command(identifier, number, voltage, at)]
            if identifier == frames.MORE_VOLTAGES and self._frame:
                self._before = frames.decode_number(data), frames.decode_voltages(identifier, data)[self._slot], at
                return self.expire(at)
            if identifier == frames.SETUP:
                self._set_up(frames.decode_setup(identifier, data), at)
            elif identifier == frames.CALL and data != frames.WHO:
                if data == frames.RESET:
                    self.reset_emergency()
                return [*self.expire(at), self._report(at)]
            elif identifier == frames.GENERAL and data[:1] == frames.EMERGENCY[:1]:
                return [*self.expire(at), self.latch_emergency(at)]
            elif identifier == motion_frames.SETPOINTS and not self._frame:
                return self._set_point(data, at)
            elif identifier == motion_frames.DATA and len(data) > 2 and data[0] == self.node:
                self.by_itself.data(data[1], data[2:], at)
        except MachineError as error:
            LOG.warning("module %s ignored a frame: %s", self.name, error)
        return []

    def force(self) -> list[bytes]:
        """Data of the frame with the load cell's signal, if one is due with the answer to a tick."""
        if self.cell is None or self.ticks % frames.FORCE_EVERY:
            return []
        return [frames.encode_force(self.cell(), self.ticks)]

    def expire(self, now: float) -> list[bytes]:
        """Cut the voltage if the last command's time is over by `now`; return the watchdog's report, if it is due."""
        self.by_itself.expire(now)
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
        self.by_itself.stop(at, MotionStatus.EMERGENCY)
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

    def control(self, data: bytes | bytearray, at: float) -> tuple[int, bytes] | None:
        """A control frame of a motion by methods A, B or C; identifier (extended) and data of the answer, if any."""
        if len(data) < 2 or data[1] not in (0, self.node):
            return None
        self.by_itself.expire(at)
        if data[0] in (Verb.BEGIN, Verb.GAIN) and (self._expires is not None or self.by_itself.moves):
            self._refuse("a motion", Verdict.STRANGE.value, at)
            return None
        try:
            answer = self.by_itself.control(data, at, self._period, self.emergency)
        except (ValueError, struct.error):
            LOG.warning("module %s ignored a control frame: %s", self.name, bytes(data).hex(" "))
            return None
        return None if answer is None else (answer[0] + self.node, answer[1])

    def _set_point(self, data: bytes | bytearray, at: float) -> list[bytes]:
        """Method A: take the set point, and answer as to a tick."""
        if not self.by_itself.active or len(data) != 2 * motion_frames.SLOTS:
            return []
        counts = self._counts(at)
        self.ticks += 1
        self.by_itself.setpoint(data, self._slot, at)
        return [frames.encode_answer(Answer(counts, self._whole_status(at), Kind.ANSWER, self.ticks))]

    def _told_before(self, number: int, at: float) -> float | None:
        """The voltage that frame 0x00F has told for the tick with this number, V; None if it was lost."""
        before, self._before = self._before, None
        if before is not None and before[0] == number and at - before[2] <= OLDEST * self._period:
            return before[1]
        return None if number else 0.0

    def _command(self, identifier: int, number: int, voltage: float | None, at: float) -> list[bytes]:
        verdict = Verdict.FRESH
        if number:
            verdict = self._freshness.judge(number, at)
        elif self._freshness.followed(at) or at < self._refused_until:
            verdict = Verdict.STRANGE
        if self.by_itself.active:
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

    def _tick(self, voltage: float | None, status: Status, at: float) -> bytes:
        """Latch the encoder; `voltage` in V acts from now on, and None leaves the one before until its time is over."""
        counts = self._counts(at)
        self.ticks += 1
        self.status = status
        if voltage is not None and not self.emergency:  # which has cut it, and what an amplifier adds to zero volts
            self.motion.command(self._scale * voltage, at)
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
    if axis.module.get("motor") == "stepper":
        raise InputError(
            f"axis {axis.name} has a stepper motor, which knows no voltage: its machine is served on a "
            "serial line (--dialect dcs)"
        )
    if axis.machine:
        return MachineParameters.from_table(axis.machine, f"[axis.{axis.name}.machine]")
    table = {key: value for key, value in axis.model.items() if key != "name"}
    return MachineParameters.from_table(table, f"[axis.{axis.name}.model], as there is no [axis.{axis.name}.machine]")
