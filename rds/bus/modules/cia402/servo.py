"""What is behind the drive's bus interface: amplifier, axis, encoder, and the cascaded loop at 4 kHz.

    velocity demand + position gain · (position demand - position)  ->  velocity PI  ->  current limit -> voltage limit

This is the cascade of mrm-control's figure 7 without the D part. The current limit is in V: what drives the current
through the armature's resistance, above the back-EMF v/K.

The loop's instants are whole multiples of 0.25 ms of bus time, and the axis moves exactly from one to the next,
however late the drive learns of it. The amplifier is a voltage amplifier without a current loop: a torque of 1000 ‰
is its full voltage. Position comes from the encoder (whole counts), velocity from a tachometer on the motor.
"""

from __future__ import annotations

from collections.abc import Callable
from math import floor

from rds.bus.modules.cia402.codes import FOLLOWING_ERROR, NEGATIVE_SWITCH, POSITIVE_SWITCH, REFERENCE_LIMIT
from rds.bus.modules.cia402.motions import Motion
from rds.core.types import SPINDLE_UNIT
from rds.machines.machine import Axis
from rds.models.machine_axis import MachineAxis, MachineParameters

TICK = 0.25e-3  # s
SPINDLE_COUNTS = 4096  # per revolution
NEGATIVE, POSITIVE, HOME = 1, 2, 4  # bits of the digital inputs 0x60FD
_INSTANT = 1e-9  # s: bus time knows nothing shorter
_BANDWIDTH = 600.0  # 1/s, of the velocity loop: a sixth of what its 0.45 ms of delay would bear
_RATIO = 6.0  # velocity loop's bandwidth to position gain: no overshoot


class Servo:
    """The axis of one drive at standstill, in counts; `volts` is what a torque of 1000 ‰ is.

    `fault(code, at)` is called with an error code and its instant when the axis leaves its limits.
    """

    def __init__(
        self,
        axis: Axis,
        parameters: MachineParameters,
        start: float,
        volts: float,
        fault: Callable[[int, float], None],
    ):
        self.rotates = axis.unit == SPINDLE_UNIT
        # the axis's position is (rev/min)·s for a spindle
        self.counts_per_unit = SPINDLE_COUNTS / 60.0 if self.rotates else 1.0 / axis.resolution
        low, high = (-1e300, 1e300) if self.rotates else axis.travel
        self._switches = low * self.counts_per_unit, high * self.counts_per_unit
        self.axis = MachineAxis(parameters, start)
        self.volts = volts
        self._fault = fault
        self.zero = 0  # raw counts where the position is 0
        self.homed = False
        self.raw = 0  # counts since the drive was switched on
        self.velocity_gain = _BANDWIDTH * parameters.tau / parameters.K  # V per unit/s
        self.position_gain = _BANDWIDTH / _RATIO  # 1/s
        self.integral_time = parameters.tau  # s
        self.voltage_limit = volts
        self.current_limit = 2.0 * volts  # V above the back-EMF: none, as that is all there can be
        self._emf = 1.0 / parameters.K  # V per unit/s
        self.motion: Motion | None = None  # leads the loop; None: no loop
        self.torque: float | None = None  # V of cyclic torque; None: no voltage by command
        self.guarded = True  # whether limit switches and software limits count (not while homing or stopping)
        self.polarity = 1  # -1: the encoder counts downwards under a positive voltage
        self.brake_is_closed = False  # then the axis does not move
        self.software_limits = (-(1 << 31), (1 << 31) - 1)
        self.following_window, self.following_time = 0xFFFFFFFF, 0.0  # counts, s
        self.position_demand = 0.0
        self.velocity_demand = 0.0
        self.following_error = 0.0
        self.limited = False  # the voltage, or the target, is at its limit
        self._integral = 0.0  # V
        self._behind_since: float | None = None
        self._ticks = floor(start / TICK)
        self._inputs = self._read_inputs()

    @property
    def position(self) -> int:
        """Counts."""
        return self.raw - self.zero

    @property
    def velocity(self) -> float:
        """Counts/s."""
        return self.axis.velocity * self.counts_per_unit

    @property
    def inputs(self) -> int:
        """The limit and home switches, as in 0x60FD; the home switch is in the middle of the travel and above."""
        return self._inputs

    @property
    def applied(self) -> float:
        """Voltage at the motor now, as a part of the full one in ‰."""
        return 1000.0 * self.polarity * self.axis.voltage / self.volts

    def lead(self, motion: Motion, demand: float | None = None) -> None:
        """Close the loop, led by `motion`; the position demand is the position if not given."""
        if self.motion is None:
            self._integral = self.axis.voltage
            self._behind_since = None
        self.motion, self.torque = motion, None
        self.position_demand = self.position if demand is None else demand

    def command(self, voltage: float, at: float) -> None:
        """Cyclic torque: this voltage from `at` on (and the axis's delay later), within the limits."""
        self.motion = None
        self.torque = voltage
        allowed = self._allowed(max(-self.voltage_limit, min(self.voltage_limit, voltage)))
        self.limited = allowed != voltage
        self._give(allowed, at)

    def _give(self, voltage: float, at: float) -> None:
        self.axis.command(0.0 if self.brake_is_closed else self.polarity * voltage, at)

    def cut(self, at: float) -> None:
        """Zero volts from the instant `at` on; what was under way is dropped."""
        self.motion = self.torque = None
        self.axis.cut(at)
        self.limited = False
        self.following_error = 0.0

    def advance(self, until: float) -> None:
        """Move on to the instant `until`, through all ticks of the loop on the way."""
        while self.motion is not None or self.torque is not None:
            tick = (self._ticks + 1) * TICK
            if tick > until:
                break
            self._ticks += 1
            self._measure(tick)
            if self.motion is not None:
                self._control(self.motion, tick)
            else:
                self._guard(tick, True)
        else:
            self._ticks = max(self._ticks, floor(until / TICK))
        self._measure(until)

    def _measure(self, now: float) -> None:
        if now - self.axis.now > _INSTANT:
            self.axis.advance(now)
        units = self.axis.position if self.rotates else self.axis.output()
        self.raw = floor(units * self.counts_per_unit + 0.5)
        self._inputs = self._read_inputs()

    def _read_inputs(self) -> int:
        low, high = self._switches
        raw = self.raw
        return (NEGATIVE if raw <= low else 0) | (POSITIVE if raw >= high else 0) | (HOME if raw >= 0 else 0)

    def _guard(self, now: float, free: bool) -> None:
        """Limit switches and, where no position is controlled (`free`), the software limits."""
        velocity, (low, high) = self.axis.velocity, self.software_limits
        if not self.guarded or velocity == 0.0:
            return
        if velocity < 0.0 and self._inputs & NEGATIVE:
            self._fault(NEGATIVE_SWITCH, now)
        elif velocity > 0.0 and self._inputs & POSITIVE:
            self._fault(POSITIVE_SWITCH, now)
        elif free and (self.position > high if velocity > 0.0 else self.position < low):
            self._fault(REFERENCE_LIMIT, now)

    def _control(self, motion: Motion, now: float) -> None:
        position, velocity = motion.step(now, TICK)
        self._guard(now, position is None)
        if self.motion is not motion:
            return  # a fault has taken over
        self.velocity_demand = velocity
        if position is not None:
            self.position_demand = position
            error = self.following_error = position - self.position
            if self._falls_behind(error, now):
                self._fault(FOLLOWING_ERROR, now)
                return
            velocity += self.position_gain * error
        else:
            self.position_demand, self.following_error, self._behind_since = self.position, 0.0, None
        error = velocity / self.counts_per_unit - self.axis.velocity
        voltage = self._integral + self.velocity_gain * error
        emf = self._emf * self.axis.velocity
        driven = max(emf - self.current_limit, min(emf + self.current_limit, voltage))
        allowed = self._allowed(max(-self.voltage_limit, min(self.voltage_limit, driven)))
        self.limited = allowed != voltage
        if not self.limited or error * (voltage - allowed) < 0.0:  # no winding up
            self._integral += self.velocity_gain * error * TICK / self.integral_time
        self._give(allowed, now)

    def _falls_behind(self, error: float, now: float) -> bool:
        """Whether the following error has been outside its window for longer than its time."""
        if abs(error) <= self.following_window or self.following_window == 0xFFFFFFFF:
            self._behind_since = None
            return False
        if self._behind_since is None:
            self._behind_since = now
        return now - self._behind_since >= self.following_time

    def _allowed(self, voltage: float) -> float:
        """No voltage further into a limit switch."""
        if self.guarded and self._inputs & (NEGATIVE | POSITIVE):
            return max(0.0, voltage) if self._inputs & NEGATIVE else min(0.0, voltage)
        return voltage
