"""Modes of operation: what each makes of its target objects and of the mode-specific bits of control- and statusword.

A mode exists while OPERATION ENABLED and the mode last. `control` gets every controlword, `target` is told that one of
the mode's target objects was written, `actuate` is the instant at which cyclic targets act, `watch` comes after every
advance in time, and `status` gives bits 10, 12 and 13 of the statusword.
"""

from __future__ import annotations

from rds.bus.modules.cia402.codes import (
    BIT_4,
    BIT_5,
    BIT_6,
    HALT,
    MODE_12,
    MODE_13,
    TARGET_REACHED,
    Mode,
)
from rds.bus.modules.cia402.dictionary import Dictionary
from rds.bus.modules.cia402.homing import METHODS, Homing
from rds.bus.modules.cia402.motions import Constant, Line, Profile, Ramp
from rds.bus.modules.cia402.servo import Servo

Limits = tuple[int, int]


class Window:
    """Whether something has held for a time."""

    def __init__(self) -> None:
        self._since: float | None = None

    def held(self, holds: bool, now: float, time: float) -> bool:
        """Tell whether it holds now; returns whether it has for `time` s."""
        if not holds:
            self._since = None
            return False
        if self._since is None:
            self._since = now
        return now - self._since >= time


class OperationMode:
    """No mode: the axis stands, led at speed zero."""

    cyclic = False  # whether its targets have to come with every SYNC

    def __init__(self, objects: Dictionary, servo: Servo, now: float):
        self.objects, self.servo = objects, servo
        self.clamped = False
        servo.guarded = True
        self.enter(now)

    def enter(self, now: float) -> None:
        """Operation has been enabled in this mode, or the mode chosen."""
        self.stop(self.objects[0x6084])

    def stop(self, deceleration: float) -> None:
        """Down to zero on a ramp."""
        self.servo.lead(Ramp(self.servo.velocity, 0.0, deceleration, deceleration))

    def control(self, word: int, now: float) -> None:
        """A controlword in OPERATION ENABLED."""

    def target(self, now: float) -> None:
        """A target object was written."""

    def actuate(self, now: float, period: float) -> None:
        """A cyclic target acts from `now`, for the next `period` s."""

    def too_old(self, now: float) -> None:
        """No new cyclic target came in time."""

    def watch(self, now: float) -> None:
        """Time has gone on."""

    def status(self) -> int:
        """Bits 10, 12 and 13 of the statusword."""
        return 0

    def limit(self, target: float) -> float:
        """The target, within the software limits."""
        low, high = self.servo.software_limits
        limited = max(low, min(high, target))
        self.clamped = limited != target
        return limited


class CyclicPosition(OperationMode):
    """CSP: bit 12 drive follows, bit 13 following error."""

    cyclic = True

    def enter(self, now: float) -> None:
        self._line = Line(self.servo.position, now, 1e-3)
        self.servo.lead(self._line)

    def actuate(self, now: float, period: float) -> None:
        self._line.aim(self.limit(self.objects[0x607A]), now, period)

    def status(self) -> int:
        return MODE_12 | _behind(self.servo)


class CyclicVelocity(OperationMode):
    """CSV: bit 12 drive follows."""

    cyclic = True

    def enter(self, now: float) -> None:
        self.servo.lead(Constant(0.0))

    def actuate(self, now: float, period: float) -> None:
        self.servo.lead(Constant(self.objects[0x60FF]))

    def too_old(self, now: float) -> None:
        self.stop(self.objects[0x6084])

    def status(self) -> int:
        return MODE_12


class CyclicTorque(OperationMode):
    """CST: bit 12 drive follows."""

    cyclic = True

    def enter(self, now: float) -> None:
        self.servo.command(0.0, now)

    def actuate(self, now: float, period: float) -> None:
        self.servo.command(self.objects[0x6071] * 1e-3 * self.servo.volts, now)

    def too_old(self, now: float) -> None:
        self.servo.command(0.0, now)

    def status(self) -> int:
        return MODE_12


class ProfilePosition(OperationMode):
    """PP: controlword bits 4 new set-point, 5 at once, 6 relative, 8 halt; status bit 12 acknowledge, 13 following."""

    def enter(self, now: float) -> None:
        here = self.servo.position
        self._profile = self._towards(here, here, self.servo.velocity)
        self.servo.lead(self._profile)
        self._new = True  # a bit that is set already is no rising edge
        self._acknowledged = False
        self._next: tuple[float, bool] | None = None
        self._window, self._reached = Window(), False

    def _towards(self, target: float, position: float, velocity: float) -> Profile:
        objects = self.objects
        return Profile(position, velocity, target, objects[0x6081], objects[0x6083], objects[0x6084])

    def control(self, word: int, now: float) -> None:
        self._profile.halted = bool(word & HALT)
        new = bool(word & BIT_4)
        rising, self._new = new and not self._new, new
        if rising and (self._next is None or word & BIT_5):
            self._acknowledged = True
            self._next = self.objects[0x607A], bool(word & BIT_6)
            if word & BIT_5 or self._profile.done or self._profile.target == self._profile.position:
                self._start_next()
        if not new and self._next is None:
            self._acknowledged = False

    def _start_next(self) -> None:
        assert self._next is not None
        (target, relative), self._next = self._next, None
        goal = self.limit(target + self._profile.target if relative else target)
        self._profile = self._towards(goal, self._profile.position, self._profile.velocity)
        self._reached = False
        self.servo.lead(self._profile, self._profile.position)

    def watch(self, now: float) -> None:
        if self._profile.done and self._next is not None:
            self._start_next()
            self._acknowledged = self._acknowledged and self._new
        near = abs(self._profile.target - self.servo.position) <= self.objects[0x6067]
        if self._profile.halted:
            near = abs(self.servo.velocity) <= self.objects[0x606F]
        self._reached = self._window.held(near, now, self.objects[0x6068] * 1e-3)

    def status(self) -> int:
        return (TARGET_REACHED if self._reached else 0) | (MODE_12 if self._acknowledged else 0) | _behind(self.servo)


class ProfileVelocity(OperationMode):
    """PV: controlword bit 8 halt; status bit 10 target reached, 12 speed is zero."""

    def enter(self, now: float) -> None:
        self._halted = False
        self._ramp = Ramp(self.servo.velocity, 0.0, self.objects[0x6083], self.objects[0x6084])
        self.servo.lead(self._ramp)
        self._reached_window, self._zero_window = Window(), Window()
        self._reached = self._zero = False

    def control(self, word: int, now: float) -> None:
        self._halted = bool(word & HALT)
        self.target(now)

    def target(self, now: float) -> None:
        self._ramp.target = 0.0 if self._halted else self.objects[0x60FF]
        self._ramp.acceleration, self._ramp.deceleration = self.objects[0x6083], self.objects[0x6084]

    def watch(self, now: float) -> None:
        velocity = self.servo.velocity
        near = abs(velocity - self._ramp.target) <= self.objects[0x606D]
        self._reached = self._reached_window.held(near, now, self.objects[0x606E] * 1e-3)
        still = abs(velocity) <= self.objects[0x606F]
        self._zero = self._zero_window.held(still, now, self.objects[0x6070] * 1e-3)

    def status(self) -> int:
        return (TARGET_REACHED if self._reached else 0) | (MODE_12 if self._zero else 0)


class HomingMode(OperationMode):
    """HM: controlword bit 4 start, 8 halt; status bits 10 target reached, 12 attained, 13 error."""

    def enter(self, now: float) -> None:
        self._new = False  # bit 4 is a level here: 1 starts, or goes on
        self._homing: Homing | None = None
        self._failed = False
        self.servo.guarded = False
        super().enter(now)

    def control(self, word: int, now: float) -> None:
        start = bool(word & BIT_4) and not word & HALT
        rising, falling = start and not self._new, self._new and not start
        self._new = start
        if rising:
            self._begin()
        elif falling and self._homing is not None:
            self._homing = None
            self.stop(self.objects[0x609A])

    def _begin(self) -> None:
        method = self.objects[0x6098]
        self.servo.homed, self._failed = False, method not in METHODS
        if not self._failed:
            values = self.objects.values
            search, creep, turn = values[0x6099, 1], values[0x6099, 2], values[0x608F, 1]
            self._homing = Homing(self.servo, method, search, creep, values[0x609A, 0], turn)
            self.servo.lead(self._homing)

    def watch(self, now: float) -> None:
        homing = self._homing
        if homing is not None and homing.done:
            assert homing.home is not None
            # zero position = home position + home offset (CiA 402, home offset 0x607C)
            self.servo.zero = homing.home + self.objects[0x607C]
            self._homing, self.servo.homed = None, True
            self.servo.lead(Line(self.servo.position, now, 1e-3))

    def status(self) -> int:
        if self._failed:
            return MODE_13 | TARGET_REACHED
        if self._homing is not None:
            return 0
        return TARGET_REACHED | (MODE_12 if self.servo.homed else 0)


def _behind(servo: Servo) -> int:
    return MODE_13 if abs(servo.following_error) > servo.following_window else 0


MODES: dict[Mode, type[OperationMode]] = {
    Mode.NONE: OperationMode,
    Mode.PROFILE_POSITION: ProfilePosition,
    Mode.PROFILE_VELOCITY: ProfileVelocity,
    Mode.HOMING: HomingMode,
    Mode.CYCLIC_POSITION: CyclicPosition,
    Mode.CYCLIC_VELOCITY: CyclicVelocity,
    Mode.CYCLIC_TORQUE: CyclicTorque,
}
TARGETS = {  # target object -> the modes that it leads
    0x607A: {Mode.CYCLIC_POSITION, Mode.PROFILE_POSITION},
    0x60FF: {Mode.CYCLIC_VELOCITY, Mode.PROFILE_VELOCITY},
    0x6071: {Mode.CYCLIC_TORQUE},
}
