"""Where the cascaded loop is led: ramps, a trapezoidal profile, and what comes with every SYNC.

Positions in counts, velocities in counts/s, accelerations in counts/s², instants in s of bus time. Each has one verb,
`step(now, T)`: the position demand at `now` (None: only velocity is controlled) and the velocity demand, `T` s after
the step before.
"""

from __future__ import annotations

from typing import Protocol

from rds.models.profile_drive import profile_step, towards

Demand = tuple[float | None, float]


class Motion(Protocol):
    """What leads the loop."""

    done: bool

    def step(self, now: float, T: float) -> Demand:
        """Position demand (or None) and velocity demand."""


class Ramp:
    """From `velocity` to `target` at constant acceleration; `done` once it is there."""

    def __init__(self, velocity: float, target: float, acceleration: float, deceleration: float):
        self.velocity, self.target = velocity, target
        self.acceleration, self.deceleration = acceleration, deceleration
        self.done = velocity == target

    def step(self, now: float, T: float) -> Demand:
        """One step of the ramp."""
        slowing = abs(self.target) < abs(self.velocity) or self.target * self.velocity < 0.0
        self.velocity = towards(self.velocity, self.target, (self.deceleration if slowing else self.acceleration) * T)
        self.done = self.velocity == self.target
        return None, self.velocity


class Profile:
    """To `target` with a trapezoidal velocity, from any position and velocity; `done` once it is there."""

    def __init__(
        self,
        position: float,
        velocity: float,
        target: float,
        speed: float,
        acceleration: float,
        deceleration: float,
    ):
        self.position, self.velocity, self.target = position, velocity, target
        self.speed, self.acceleration, self.deceleration = speed, acceleration, deceleration
        self.halted = False
        self.done = False

    def step(self, now: float, T: float) -> Demand:
        """One step, never faster than can still be braked before the target."""
        self.position, self.velocity, arrived = profile_step(
            self.position,
            self.velocity,
            self.target,
            self.speed,
            self.acceleration,
            self.deceleration,
            T,
            self.halted,
        )
        self.done = self.done or arrived
        return self.position, self.velocity


class Line:
    """Cyclic synchronous position: a straight line from the last target to the new one in one period, then hold."""

    done = False

    def __init__(self, position: float, now: float, period: float):
        self._from = self._to = position
        self._since, self._period = now, period
        self.position = position

    def aim(self, target: float, now: float, period: float) -> None:
        """A new target, from where the demand is at `now`."""
        self._from, self._to = self._at(now), target
        self._since, self._period = now, period

    def _at(self, now: float) -> float:
        part = (now - self._since) / self._period
        return self._to if part >= 1.0 else self._from + (self._to - self._from) * max(part, 0.0)

    def step(self, now: float, T: float) -> Demand:
        """The demand on the line, and its slope."""
        self.position = self._at(now)
        moving = now - self._since < self._period * 1.5  # a SYNC that is a little late is no reason to brake
        return self.position, (self._to - self._from) / self._period if moving else 0.0


class Constant:
    """Cyclic synchronous velocity: the target as it is."""

    done = False

    def __init__(self, velocity: float):
        self.velocity = velocity

    def step(self, now: float, T: float) -> Demand:
        """The target."""
        return None, self.velocity
