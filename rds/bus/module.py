"""A virtual axis module: amplifier, axis and encoder behind one CAN node. It knows frames and bus time, no bus.

On a tick the module latches its encoder at the frame's time stamp, takes the voltage of its slot (which acts the
axis's delay later), and answers with one frame. Its time is real time: the axis moves on by the bus time that has
passed, however late the module learns of it. Without a command for `WATCHDOG_PERIODS` sample periods the output is
zero volts from exactly that instant until the next command.
"""

from __future__ import annotations

import logging
from math import floor

from rds.bus import frames
from rds.bus.frames import Answer, Kind, Status
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
        self.motion = MachineAxis(machine_parameters(axis), start, axis.unit == SPINDLE_UNIT)
        self.status = Status.NONE
        self.ticks = 0
        self._slot = slot
        self._resolution = axis.resolution
        self._patience = WATCHDOG_PERIODS * sample_period
        self._expires: float | None = None

    @property
    def expires(self) -> float | None:
        """The instant at which the watchdog cuts the voltage if no command comes, bus time in s; None if it has."""
        return self._expires

    def receive(self, identifier: int, data: bytes | bytearray, at: float) -> list[bytes]:
        """Take a frame stamped `at` (s); return the data of the frames to answer with.

        A frame that makes no sense changes nothing, and is reported in the log.
        """
        try:
            if identifier in (frames.COMMAND, frames.DRY_COMMAND):
                voltage = frames.decode_voltages(identifier, data)[self._slot]
                return [*self.expire(at), self._tick(voltage, identifier == frames.DRY_COMMAND, at)]
            if identifier == frames.SETUP:
                self._patience = WATCHDOG_PERIODS * frames.decode_setup(identifier, data)
            elif identifier == frames.CALL:
                return [*self.expire(at), self._report(at)]
        except MachineError as error:
            LOG.warning("module %s ignored a frame: %s", self.name, error)
        return []

    def expire(self, now: float) -> list[bytes]:
        """Cut the voltage if the watchdog's instant has passed by `now`; return the report to send, if any."""
        if self._expires is None or now < self._expires:
            return []
        instant, self._expires = self._expires, None
        self.motion.cut(instant)
        self.status = Status.WATCHDOG
        LOG.info("module %s: no command for %g s, zero volts", self.name, self._patience)
        return [self._report(instant)]

    def _tick(self, voltage: float, dry: bool, at: float) -> bytes:
        counts = self._counts(at)
        self.ticks += 1
        self.motion.command(0.0 if dry else voltage, at)
        self.status = Status.DRY_RUN if dry else Status.ENABLED
        self._expires = at + self._patience
        return frames.encode_answer(Answer(counts, self.status, Kind.ANSWER, self.ticks))

    def _report(self, at: float) -> bytes:
        return frames.encode_answer(Answer(self._counts(at), self.status, Kind.REPORT, self.ticks))

    def _counts(self, at: float) -> int:
        """What the encoder shows at the instant: the nearest whole count."""
        return floor(self.motion.advance(at) / self._resolution + 0.5)


def machine_parameters(axis: Axis) -> MachineParameters:
    """The axis's [machine] table; where there is none, the machine is what its model says."""
    if axis.machine:
        return MachineParameters.from_table(axis.machine, f"[axis.{axis.name}.machine]")
    table = {key: value for key, value in axis.model.items() if key != "name"}
    return MachineParameters.from_table(table, f"[axis.{axis.name}.model], as there is no [axis.{axis.name}.machine]")
