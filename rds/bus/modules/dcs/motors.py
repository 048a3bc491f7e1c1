"""The motors behind a unit: a stepper, or a servo motor on an analogue or PWM output (three-axis-mill's three kinds).

A unit says to its motor: so many steps within so much time, or a voltage; and asks for its counts. A stepper has no
encoder: its counts are the steps it was sent. A servo motor makes steps by a position loop of the unit: each
millisecond u = (v + Kp e)/K, with v the speed of the step, e the position error, and K of the axis's own model. A
spindle makes no steps: of a step of n BLU it gets n/127 of the output's range.
"""

from __future__ import annotations

from math import floor, inf
from typing import Protocol

from rds.bus.modules.dcs.commands import MOST_STEPS
from rds.core.errors import InputError
from rds.machines.machine import Axis
from rds.models.machine_axis import MachineAxis, MachineParameters
from rds.models.stepper_axis import StepperAxis, StepperParameters

_LOOP = 1e-3  # s, of the position loop
_STIFF = 30.0  # 1/s, Kp of the position loop: chosen, for time constants of some 10 ms
_DUTIES = 255  # levels of a PWM output, each way


class Motor(Protocol):
    """What a unit needs of the axis behind it. Instants in s, and positions in axis units."""

    kind: str
    turns: bool  # a spindle: it goes on until something else is said

    @property
    def lost(self) -> int:
        """Steps that the motor did not make."""

    def steps(self, count: int, at: float, time: float) -> None:
        """`count` BLU within `time` s from the instant `at` on."""

    def voltage(self, volts: float, at: float) -> None:
        """A voltage from the instant `at` on; a stepper takes it for a rate."""

    def stop(self, at: float) -> None:
        """Nothing more from the instant `at` on."""

    def advance(self, until: float) -> float:
        """Where the carriage really is at the instant `until`."""

    def counts(self, at: float) -> int:
        """What the unit knows of the position, in BLU."""

    @property
    def moving(self) -> bool:
        """Whether it moves."""


class Stepper:
    """A stepper behind its driver."""

    kind, turns = "stepper", False

    def __init__(self, axis: Axis, start: float):
        self._gain = StepperParameters.from_table(axis.machine, f"[axis.{axis.name}.machine]")
        self._axis = StepperAxis(self._gain, axis.resolution, start)

    @property
    def lost(self) -> int:
        """Steps that the motor did not make."""
        return self._axis.lost

    @property
    def moving(self) -> bool:
        """Whether it moves, or is going to."""
        return self._axis.moving

    def steps(self, count: int, at: float, time: float) -> None:
        """As Motor."""
        self._axis.move(count, at, time)

    def voltage(self, volts: float, at: float) -> None:
        """As Motor: K u is the speed of the pulses."""
        self._axis.rate(self._gain.K * volts, at)

    def stop(self, at: float) -> None:
        """As Motor."""
        self._axis.stop(at)

    def advance(self, until: float) -> float:
        """As Motor."""
        return self._axis.advance(until)

    def counts(self, at: float) -> int:
        """As Motor: the steps that were sent."""
        self._axis.advance(at)
        return self._axis.counts


class Servo:
    """A direct-current motor with an encoder, on an analogue output (12 bits) or a PWM one (255 duties)."""

    lost = 0  # it has an encoder

    def __init__(self, axis: Axis, start: float, kind: str, volts: float):
        self.kind = kind
        table = axis.machine or {key: value for key, value in axis.model.items() if key != "name"}
        self._axis = MachineAxis(
            MachineParameters.from_table(table, f"[axis.{axis.name}.machine]"), start, axis.is_spindle
        )
        self.turns = axis.is_spindle
        self._blu = axis.resolution
        self._grain = volts / (_DUTIES if kind == "pwm" else 2048)
        self._volts = volts
        self._next = inf  # when the position loop is due
        self._target, self._from, self._since, self._time = 0, 0.0, start, 0.0

    @property
    def moving(self) -> bool:
        """Whether it moves, or is held in place by its loop."""
        return self._axis.velocity != 0.0 or self._next < inf

    def steps(self, count: int, at: float, time: float) -> None:
        """As Motor; an axis that no step has moved yet is not held."""
        if self.turns:
            self.voltage(count / MOST_STEPS * self._volts, at)
            return
        self._run(at)
        if count == 0 and self._next == inf:
            return
        if self._next == inf:
            self._target = self._counts()
        self._from, self._since, self._time = float(self._target), at, time
        self._target += count
        self._next = min(self._next, at)

    def voltage(self, volts: float, at: float) -> None:
        """As Motor."""
        self._run(at)
        self._next = inf
        self._drive(volts, at)

    def stop(self, at: float) -> None:
        """As Motor."""
        self._run(at)
        self._next = inf
        self._axis.cut(at)

    def advance(self, until: float) -> float:
        """As Motor."""
        self._run(until)
        return self._axis.advance(until)

    def counts(self, at: float) -> int:
        """As Motor: what the encoder shows."""
        self.advance(at)
        return self._counts()

    def _counts(self) -> int:
        return floor(self._axis.output() / self._blu + 0.5)

    def _drive(self, volts: float, at: float) -> None:
        level = min(max(volts, -self._volts), self._volts)
        self._axis.command(round(level / self._grain) * self._grain, at)

    def _run(self, until: float) -> None:
        """The position loop, as far as it is due."""
        gain = self._axis.parameters.K
        while self._next <= until:
            now = self._next
            self._axis.advance(now)
            share = min(max((now - self._since) / self._time, 0.0), 1.0) if self._time else 1.0
            wanted = self._from + share * (self._target - self._from)
            speed = (self._target - self._from) * self._blu / self._time if share < 1.0 else 0.0
            error = (wanted - self._counts()) * self._blu
            self._drive((speed + _STIFF * error) / gain, now)
            self._next = now + _LOOP


def make_motor(axis: Axis, start: float, volts: float) -> Motor:
    """The motor that the machine's file says ([axis.NAME.module] motor); `volts` is the range of its output.

    InputError for a stepper that turns a spindle, and for parameters that can't be.
    """
    kind = axis.module.get("motor", "analogue")
    if kind == "stepper":
        if axis.is_spindle:
            raise InputError(f"axis {axis.name} is a spindle; a stepper makes steps: motor must be analogue or pwm")
        return Stepper(axis, start)
    return Servo(axis, start, kind, volts)
