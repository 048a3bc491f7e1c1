"""The machine's own axis: what a student's model is compared against.

Motor and carriage, with the velocity v in mm/s (rev/min for a spindle), the voltage u in V:

    τ v' + v = K u - F(v)                                                      (linear axis of the paper)
    F(v) = F± (1 + s exp(-(v/v_s)²)) + b v,      F+ for v > 0, F- (negative) for v < 0

F± is Coulomb friction per direction, s the Stribeck part, b the viscous part. At rest the axis sticks while
F-(1+s) <= K u <= F+(1+s). Between motor and encoder is a dead zone of play (backlash), and a voltage acts a stated
delay after its command arrived.

Time is real time, not samples: `advance` goes to any instant. Between two commands the voltage is constant; then the
time is cut into equal substeps of at most `SUBSTEP`. The Stribeck friction level is frozen over each, at the speed
predicted for its middle, which leaves a linear equation with a closed form; the instant at which the velocity crosses
zero is exact, and from there the axis sticks or starts the other way. Without Stribeck friction the closed form holds
however long the time, and no substeps are taken.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import ceil, exp, expm1, inf, isfinite, log1p

from rds.core.errors import InputError

# 1/40 of the shortest time constant here (10 ms). Against substeps of 1 µs the position differs by less than 1e-6 mm
# (a thousandth of an encoder count) over several reversals; a module's four substeps per ms cost 4 µs.
SUBSTEP = 0.25e-3  # s


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

    def __post_init__(self) -> None:
        for name in ("tau", "K", "stribeck_velocity"):
            if not getattr(self, name) > 0:
                raise InputError(f"machine parameter {name} = {getattr(self, name)!r} must be more than 0")
        for name in ("friction_plus", "viscous", "stribeck", "backlash", "delay"):
            if not getattr(self, name) >= 0:
                raise InputError(f"machine parameter {name} = {getattr(self, name)!r} must be 0 or more")
        if not self.friction_minus <= 0:
            raise InputError(f"machine parameter friction_minus = {self.friction_minus!r} must be 0 or less")

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
        self._rate = (1.0 + parameters.viscous) / parameters.tau  # 1/s
        self._speed_output = speed_output
        self._now = start
        self._voltage = 0.0
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
        self._commands.clear()
        self._voltage = 0.0

    def advance(self, until: float) -> float:
        """Move on to the instant `until` and return the output there; earlier instants change nothing."""
        while self._commands and self._commands[0][0] <= until:
            instant, voltage = self._commands.popleft()
            self._move(instant - self._now)
            self._now = max(self._now, instant)
            self._voltage = voltage
        self._move(until - self._now)
        self._now = max(self._now, until)
        return self.output()

    def output(self) -> float:
        """What the encoder sees, before it is quantized: mm behind the play, or rev/min of a spindle."""
        return self.velocity if self._speed_output else self._carriage

    def _move(self, time: float) -> None:
        """Constant voltage for `time` s."""
        if time <= 0:
            return
        p = self.parameters
        pull = p.K * self._voltage
        steps = max(ceil(time / SUBSTEP - 1e-9), 1) if p.stribeck else 1
        step = time / steps
        for _ in range(steps):
            if self.velocity == 0.0 and self._sticks(pull):
                return  # and stays so as long as the voltage does
            self._substep(pull, step)

    def _sticks(self, pull: float) -> bool:
        p = self.parameters
        breakaway = 1.0 + p.stribeck
        return p.friction_minus * breakaway <= pull <= p.friction_plus * breakaway

    def _substep(self, pull: float, time: float) -> None:
        """The closed form over a time in which the friction level is frozen, in parts if the axis comes to rest."""
        rate = self._rate
        while time > 0.0:
            v = self.velocity
            if v == 0.0 and self._sticks(pull):
                return
            p = self.parameters
            friction = p.friction_plus if v > 0.0 or (v == 0.0 and pull > 0.0) else p.friction_minus
            final = self._final(pull, friction, v)
            if p.stribeck:
                middle = final + (v - final) * exp(-0.5 * rate * time)
                final = self._final(pull, friction, middle if middle * v >= 0.0 else 0.0)
            # the velocity is zero where (v - final) exp(-rate t) = -final
            crossing = log1p(-v / final) / rate if final * v < 0.0 else inf
            part = min(time, crossing)
            passed = -expm1(-rate * part)
            self._shift(final * part + (v - final) * passed / rate)
            self.velocity = 0.0 if crossing <= time else v + (final - v) * passed
            time -= part

    def _final(self, pull: float, friction: float, v: float) -> float:
        """The velocity that the axis would end at if the friction stayed as it is at velocity v."""
        p = self.parameters
        level = friction * (1.0 + p.stribeck * exp(-((v / p.stribeck_velocity) ** 2))) if p.stribeck else friction
        return (pull - level) / (1.0 + p.viscous)

    def _shift(self, distance: float) -> None:
        """Move the motor one way, and the carriage with it once the play is used up."""
        self.position += distance
        half = 0.5 * self.parameters.backlash
        self._carriage = min(max(self._carriage, self.position - half), self.position + half)
