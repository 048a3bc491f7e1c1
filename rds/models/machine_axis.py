"""The machine's own axis: what a student's model is compared against.

Motor and carriage, with the velocity v in mm/s (rev/min for a spindle), the voltage u in V:

    τ v' + v = K u - F(v)                                                      (linear axis of the paper)
    F(v) = F± (1 + s exp(-(v/v_s)²)) + b v,      F+ for v > 0, F- (negative) for v < 0

F± is Coulomb friction per direction, s the Stribeck part, b the viscous part. At rest the axis sticks while
F-(1+s) <= K u <= F+(1+s). The amplifier may add an offset to its voltage, and have a dead zone. Between motor and
encoder is a dead zone of play (backlash), and a voltage acts a stated delay after its command arrived.

Time is real time, not samples: `advance` goes to any instant. Between two commands the voltage is constant; then the
time is cut into equal substeps (`machine_motion.SUBSTEP`). The Stribeck friction level is frozen over each, at the
speed predicted for its middle, which leaves a linear equation with a closed form; the instant at which the velocity
crosses zero is exact, and from there the axis sticks or starts the other way. Without Stribeck friction the closed
form holds however long the time, and no substeps are taken.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import isfinite

from rds.core.errors import InputError
from rds.models.machine_motion import moved, pull_of


@dataclass(frozen=True)
class MachineParameters:
    """An `[axis.NAME.machine]` table; lengths in mm for a linear axis, speeds in rev/min for a spindle."""

    tau: float  # s
    K: float  # (mm/s)/V
    friction_plus: float = 0.0  # mm/s, at high speed, >= 0
    friction_minus: float = 0.0  # mm/s, at high speed, <= 0
    viscous: float = 0.0  # (mm/s) of lost speed per mm/s
    stribeck: float = 0.0  # extra friction at standstill, as a fraction of the friction at high speed
    stribeck_velocity: float = 1.0  # mm/s
    backlash: float = 0.0  # mm, whole width of the play
    delay: float = 0.0  # s, from the command to the amplifier's output
    offset: float = 0.0  # V, of the amplifier: added to the command
    dead_zone: float = 0.0  # V, half width: what is smaller is no voltage, what is larger is so much less

    def __post_init__(self) -> None:
        for name in ("tau", "K", "stribeck_velocity"):
            if not getattr(self, name) > 0:
                raise InputError(f"machine parameter {name} = {getattr(self, name)!r} must be more than 0")
        for name in ("friction_plus", "viscous", "stribeck", "backlash", "delay", "dead_zone"):
            if not getattr(self, name) >= 0:
                raise InputError(f"machine parameter {name} = {getattr(self, name)!r} must be 0 or more")
        if not self.friction_minus <= 0:
            raise InputError(f"machine parameter friction_minus = {self.friction_minus!r} must be 0 or less")

    def motion(self) -> tuple[float, ...]:
        """What `machine_motion.moved` needs after its first five arguments."""
        return (
            self.tau,
            1.0 + self.viscous,
            self.friction_plus,
            self.friction_minus,
            self.stribeck,
            self.stribeck_velocity,
            0.5 * self.backlash,
        )

    @classmethod
    def from_table(cls, table: Mapping[str, float], where: str | None = None) -> MachineParameters:
        """From a TOML table; InputError for an unknown or missing key or a value that can't be."""
        known = {f.name for f in fields(cls)}
        for key, value in table.items():
            if key not in known:
                raise InputError(f"unknown machine parameter {key!r}; known: {', '.join(sorted(known))}", where)
            if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
                raise InputError(f"machine parameter {key} = {value!r} must be a number", where)
        for key in ("tau", "K"):
            if key not in table:
                raise InputError(f"machine parameter {key!r} is missing", where)
        try:
            return cls(**table)
        except InputError as error:
            raise InputError(str(error), where) from None


class MachineAxis:
    """One axis in motion from rest at position 0. Instants are in s on any one clock, and must not go back.

    `speed_output` makes the velocity the output (a spindle) instead of the position behind the play.
    """

    def __init__(self, parameters: MachineParameters, start: float = 0.0, speed_output: bool = False):
        self.parameters = parameters
        self.velocity = 0.0  # mm/s
        self.position = 0.0  # mm, of the motor
        self._carriage = 0.0  # mm, behind the play
        self._constants = parameters.motion()
        self._speed_output = speed_output
        self._now = start
        self._voltage = 0.0
        self._pull = 0.0  # mm/s: without a command there is no voltage, and no amplifier's offset
        self._commands: deque[tuple[float, float]] = deque()  # (instant from which it acts, V)

    @property
    def now(self) -> float:
        """The instant up to which the axis has moved, s."""
        return self._now

    @property
    def voltage(self) -> float:
        """What the amplifier puts out now, V."""
        return self._voltage

    def command(self, voltage: float, at: float) -> None:
        """A command arrives at the instant `at`, and acts the delay later."""
        self._commands.append((at + self.parameters.delay, voltage))

    def cut(self, at: float) -> None:
        """Zero volts from the instant `at` on, without delay; commands that wait are dropped."""
        self.advance(at)
        self._release()

    def _release(self) -> None:
        """Zero volts from now on, and nothing that the amplifier adds to them."""
        self._commands.clear()
        self._voltage = self._pull = 0.0

    def advance(self, until: float) -> float:
        """Move on to the instant `until` and return the output there; earlier instants change nothing."""
        p = self.parameters
        while self._commands and self._commands[0][0] <= until:
            instant, voltage = self._commands.popleft()
            self._move(instant - self._now)
            self._now = max(self._now, instant)
            self._voltage = voltage
            self._pull = pull_of(voltage, p.K, p.offset, p.dead_zone)
        self._move(until - self._now)
        self._now = max(self._now, until)
        return self.output()

    def output(self) -> float:
        """What the encoder sees, before it is quantized: mm behind the play, or rev/min of a spindle."""
        return self.velocity if self._speed_output else self._carriage

    def _move(self, time: float) -> None:
        """Constant voltage for `time` s."""
        self.position, self.velocity, self._carriage = moved(
            self.position, self.velocity, self._carriage, self._pull, time, *self._constants
        )
