"""Homing (CiA 402, mode 6): the methods as data, and the motion that carries one out.

| method | home is                                                         |
| ------ | --------------------------------------------------------------- |
| 1, 2   | the first index pulse after the negative (2: positive) switch was left |
| 17, 18 | where the negative (18: positive) limit switch was left         |
| 33, 34 | the next index pulse in negative (34: positive) direction       |
| 35, 37 | here                                                            |
"""

from __future__ import annotations

from math import copysign, floor
from typing import NamedTuple

from rds.bus.modules.cia402.motions import Demand
from rds.bus.modules.cia402.servo import NEGATIVE, POSITIVE, Servo
from rds.models.profile_drive import towards

_STANDS = 1e-6  # unit/s: a loop that balances the friction exactly comes to rest in the limit only


class Method(NamedTuple):
    """What a homing method looks for."""

    switch: int  # bit of 0x60FD; 0: none
    pulse: bool  # whether home is an index pulse
    direction: int  # of the first move; 0: none


METHODS = {
    1: Method(NEGATIVE, True, -1),
    2: Method(POSITIVE, True, +1),
    17: Method(NEGATIVE, False, -1),
    18: Method(POSITIVE, False, +1),
    33: Method(0, True, -1),
    34: Method(0, True, +1),
    35: Method(0, False, 0),
    37: Method(0, False, 0),
}


class Homing:
    """A homing under way. `home` is the raw count of the home position once it was found; `done` once at rest there.

    Speeds in counts/s: `search` to the switch, `creep` away from it and to the index pulse, of which there is one
    every `increments` counts.
    """

    def __init__(self, servo: Servo, method: int, search: float, creep: float, acceleration: float, increments: int):
        self._servo, self._method = servo, METHODS[method]
        self._search, self._creep, self._acceleration = search, creep, acceleration
        self._increments = increments
        self._velocity = servo.velocity
        self._pulse: int | None = None  # number of the index interval that it came from
        self.home: int | None = None
        self.done = False
        self._step = self._to_switch if self._method.switch else self._to_index
        if not self._method.direction:
            self._found(servo.raw)

    def step(self, now: float, T: float) -> Demand:
        """The velocity to go at."""
        wanted = self._step()
        self._velocity = towards(self._velocity, wanted, self._acceleration * T)
        if self.home is not None and self._velocity == 0.0 and abs(self._servo.axis.velocity) < _STANDS:
            self.done = True
        return None, self._velocity

    def _to_switch(self) -> float:
        if self._servo.inputs & self._method.switch:
            self._step = self._off_switch
        return copysign(self._search, self._method.direction)

    def _off_switch(self) -> float:
        if not self._servo.inputs & self._method.switch and self._velocity * self._method.direction < 0.0:
            if self._method.pulse:
                self._step = self._to_index
                return self._to_index()
            self._found(self._servo.raw)
            return 0.0
        return copysign(self._creep, -self._method.direction)

    def _to_index(self) -> float:
        way = -self._method.direction if self._method.switch else self._method.direction
        interval = floor(self._servo.raw / self._increments)
        if self._pulse is None:
            self._pulse = interval
        if interval != self._pulse:
            self._found(max(interval, self._pulse) * self._increments)
            return 0.0
        return copysign(self._creep, way)

    def _found(self, raw: int) -> None:
        self.home = raw
        self._step = self._stand

    def _stand(self) -> float:
        return 0.0
