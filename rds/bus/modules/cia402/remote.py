"""What the host knows of one drive, and its two process data objects as bytes. No bus here."""

from __future__ import annotations

from struct import Struct

import can

from rds.bus.modules.cia402 import codes
from rds.bus.modules.cia402.codes import State, state_of
from rds.bus.modules.cia402.mapping import Layout, standard
from rds.bus.modules.cia402.settings import Command, DriveSettings
from rds.bus.modules.drivers_base import Module
from rds.core.errors import InputError

_HALF, _TURN = 1 << 31, 1 << 32
_LAST_BIT = 1.0 + 1e-12  # by which the largest voltage, as a target, may be beyond its limit

# The controlword that leads from a state towards OPERATION ENABLED; where power stays off, the way ends before.
_TOWARDS = {
    State.NOT_READY: codes.DISABLE_VOLTAGE,
    State.SWITCH_ON_DISABLED: codes.SHUTDOWN,
    State.READY: codes.SWITCH_ON,
    State.SWITCHED_ON: codes.ENABLE_OPERATION,
    State.OPERATION_ENABLED: codes.ENABLE_OPERATION,
}


class Remote(Module):
    """One drive: its frames, and what it said last. Values are in the axis's units, or V for torque."""

    __slots__ = (
        "_command",
        "_factor",
        "_handed",
        "_highest",
        "_pack",
        "_placed",
        "_settings",
        "_size",
        "_torque_limit",
        "_unpack",
        "answers_at",
        "controlword",
        "emergency",
        "enabled",
        "heard_at",
        "message",
        "state",
        "status",
        "target",
        "was_enabled",
    )

    def __init__(self, settings: DriveSettings, absolute: bool = False):
        per_unit = settings.velocity_counts if settings.reads_velocity else settings.counts
        super().__init__(
            settings.name, settings.direction / per_unit, absolute=absolute or settings.reads_velocity
        )  # a speed has no origin
        self._settings, self._command = settings, settings.command
        torque = settings.command is Command.CST
        self._factor = (
            settings.direction
            * {
                Command.CST: 1000.0 / settings.rated_voltage,
                Command.CSP: settings.counts,
                Command.PP: settings.counts,
                Command.CSV: settings.velocity_counts,
            }[settings.command]
        )
        self._torque_limit = settings.torque_limit if torque else _HALF - 1
        self._highest = settings.highest_voltage * abs(self._factor) if torque else _HALF - 1  # in the drive's units
        self.use(standard(settings))
        self.controlword = codes.DISABLE_VOLTAGE
        self.target = 0  # in the drive's units, as the next RPDO carries it
        self._placed: int | None = None  # mode pp: the target that the RPDO before carried,
        self._handed: int | None = None  # and the last one that was handed over as a new set-point
        self.status = 0
        self.state: State | None = None
        self.enabled = self.was_enabled = False
        self.emergency = 0  # error code of the last emergency message; 0 none
        self.heard_at = 0.0  # s, of the last heartbeat; infinite before the first

    def use(self, layout: Layout) -> None:
        """Where the words stand in the PDOs."""
        self._pack = Struct(layout.command).pack_into
        answer = Struct(layout.answer)  # statusword, actual position or velocity
        self._unpack, self._size = answer.unpack_from, answer.size
        self.answers_at = layout.send
        self.message = can.Message(arbitration_id=layout.receive, is_extended_id=False, data=bytes(layout.command_size))

    @property
    def fixed_mapping(self) -> bool:
        """Whether its PDOs are used as they are."""
        return self._settings.fixed_mapping

    @property
    def node(self) -> int:
        """Node-ID."""
        return self._settings.node

    def take_status(self, message: can.Message, late: bool = False) -> Remote | None:
        """As DriversBase._take, of a TPDO. A late one holds a position that is not this cycle's."""
        if late:
            return self
        data = message.data
        if len(data) < self._size:
            return None
        self.status, self.counts = self._unpack(data)
        if self.status & 0x6F != 0x27 or not self.enabled:
            self.state = state_of(self.status)
            self.enabled = self.state is State.OPERATION_ENABLED
        return self

    def aim(self, value: float) -> float:
        """Take the next target (V, or the axis's unit, or unit/s); returns it as it will be sent.

        A voltage beyond the torque limit is sent as that limit. Raises InputError for one beyond the converter's range,
        and for a target that the drive's numbers can't say.
        """
        target = value * self._factor
        if not abs(target) <= self._highest * _LAST_BIT:  # false for NaN too
            unit, limit = self._unit()
            raise InputError(f"{value!r} {unit} for {self} must be from -{limit:g} to {limit:g} {unit}")
        self.target = max(-self._torque_limit, min(self._torque_limit, round(target)))
        if self._command.leads_position:
            self.target = (self.target + self.origin + _HALF) % _TURN - _HALF
            return round(target) / self._factor
        return self.target / self._factor

    def hold(self) -> None:
        """The target at which nothing moves: no torque, no velocity, or the position where the axis is."""
        self.target = self.counts if self._command.leads_position else 0

    @property
    def resting(self) -> float:
        """The target at which nothing moves, as `aim` takes it: axis unit, unit/s or V."""
        return (self.counts - self.origin) * self.per_count if self._command.leads_position else 0.0

    def forget_set_points(self) -> None:
        """No set-point has been handed over: the next target is a new one, wherever it is."""
        self._placed = self._handed = None

    def operate(self) -> None:
        """Set the controlword of an enabled drive, with the hand-over of a new set-point in mode pp.

        Bit 4 rises one cycle after the target was there, since a drive may take the objects of an RPDO one after the
        other, and falls once the drive acknowledges by bit 12 of the statusword. Bit 5: at once, whatever moves.
        """
        self.controlword = codes.ENABLE_OPERATION
        if self._command is not Command.PP:
            return
        if self.status & codes.MODE_12:
            self._placed = None
        elif self._placed is not None and self._placed == self.target != self._handed:
            self._handed = self._placed
        elif self._handed != self.target:
            self._placed = self.target
            return
        if self._placed is not None and self._handed == self._placed:
            self.controlword |= codes.BIT_4 | codes.BIT_5

    def fill(self) -> can.Message:
        """The RPDO with controlword and target as they are."""
        self._pack(self.message.data, 0, self.controlword, self.target)
        return self.message

    def quit(self) -> None:
        """Set the controlword that takes the power: at once in mode cst, by a quick stop in the others."""
        self.controlword = codes.DISABLE_VOLTAGE if self._command is Command.CST else codes.QUICK_STOP

    def lead(self, arm: bool) -> None:
        """Set the controlword towards OPERATION ENABLED, or with `arm` false no further than SWITCHED ON."""
        state = self.state or State.NOT_READY
        if not arm and state in (State.SWITCHED_ON, State.OPERATION_ENABLED):
            self.controlword = codes.SWITCH_ON
        else:
            self.controlword = _TOWARDS.get(state, codes.DISABLE_VOLTAGE)

    def _unit(self) -> tuple[str, float]:
        unit = self._settings.axis.unit
        name = {
            Command.CST: "V",
            Command.CSP: unit,
            Command.PP: unit,
            Command.CSV: unit if self._settings.reads_velocity else f"{unit}/s",
        }
        return name[self._command], self._highest / abs(self._factor)
