"""An axis behind a stepper motor, which loses steps where it is asked for more torque than it has.

Pulses turn the motor's field by whole steps, of one BLU each. The rotor follows within two steps: its acceleration is
what the torque leaves above friction and weight, all as accelerations of the carriage (torque over inertia, mm/s²):

    -M(v) - f sgn(v) - w  <=  dv/dt  <=  M(v) - f sgn(v) - w,      M(v) = M0 up to the corner speed,
                                                                   falling to 0 in a straight line at the speed v0

Where the rotor is more than two full steps behind its field (or before it), it falls into the next place of
equilibrium, four steps away: those steps are lost, and nobody is told (dcs-thesis, 5.5: a workpiece deformed in Z,
because "rapid change in the speed of the Z axis" asks for more than its driver gives). From standstill the motor can
follow a sudden speed of √(4 BLU (M0 - f)) at most. The thesis gives no curve of its motors; the model is the usual one
of a stepper's torque-speed curve, with the rotor's oscillation about its equilibrium left out.

The pulse generator takes rates: a voltage stands for a speed of K u. Time is cut into substeps of 0.25 ms.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, copysign

from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import Quantity

PARAMETERS = {
    "K": Quantity("speed of the pulse generator", "(mm/s)/V", above=0.0),
    "torque": Quantity("torque at standstill over inertia", "mm/s²", above=0.0),
    "corner": Quantity("speed from which the torque falls", "mm/s", low=0.0),
    "no_torque": Quantity("speed at which there is none left", "mm/s", above=0.0),
    "friction": Quantity("friction over inertia", "mm/s²", low=0.0),
    "weight": Quantity("weight over inertia, pulling backward", "mm/s²"),
    "scale": Quantity("true length of a step over its nominal one (lead screw error)", "", 0.9, 1.1),
}
SUBSTEP = 0.25e-3  # s
HOLDS = 2  # full steps that the rotor may be off its field
SLIPS = 4  # full steps from one equilibrium to the next
_TIGHT = 2e-3  # s in which the rotor makes good what it is off its field
_NOW = 1e-9  # s: rounding of instants
_SAME = 1e-6  # steps, and steps/s: no difference


@dataclass(frozen=True)
class StepperParameters:
    """The `[axis.NAME.machine]` table of an axis with a stepper motor."""

    K: float
    torque: float
    corner: float
    no_torque: float
    friction: float = 0.0
    weight: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name, declared in PARAMETERS.items():
            declared.check(getattr(self, name), name, "machine parameter")
        if self.no_torque <= self.corner:
            raise InputError(f"no_torque = {self.no_torque:g} mm/s must be above corner = {self.corner:g} mm/s")
        if self.torque <= self.friction + abs(self.weight):
            raise InputError(
                f"torque = {self.torque:g} mm/s² must be above friction and weight together "
                f"({self.friction + abs(self.weight):g} mm/s²), or the axis never moves"
            )

    @classmethod
    def from_table(cls, table: Mapping[str, float], where: str | None = None) -> StepperParameters:
        """From a TOML table; InputError for an unknown or missing key or a value that can't be."""
        try:
            check_known(table, PARAMETERS, "the stepper axis")
            for key in ("K", "torque", "corner", "no_torque"):
                if key not in table:
                    raise InputError(f"machine parameter {key} is missing; give it ({PARAMETERS[key].described})")
            return cls(**table)
        except InputError as error:
            raise InputError(str(error), where) from None

    def margin(self, speed: float, forward: bool = True) -> float:
        """The acceleration (mm/s²) that is left for speeding up at `speed` (mm/s, >= 0); where negative, it stalls."""
        left = self.torque
        if speed > self.corner:
            left = self.torque * max(0.0, self.no_torque - speed) / (self.no_torque - self.corner)
        return left - self.friction - (self.weight if forward else -self.weight)

    def pull_in(self, step: float, forward: bool = True) -> float:
        """The highest sudden speed (mm/s) that is followed from standstill without loss, for steps of `step` mm."""
        return (2.0 * HOLDS * step * self.margin(0.0, forward)) ** 0.5

    def pull_out(self, forward: bool = True) -> float:
        """The highest speed (mm/s) at which the motor still holds its load."""
        need = self.friction + (self.weight if forward else -self.weight)
        share = min(max(need, 0.0) / self.torque, 1.0)
        return self.no_torque - share * (self.no_torque - self.corner)


class StepperAxis:
    """One axis in motion, at rest at position 0 at the instant `start`. Instants (s) must not go back.

    `step` is the BLU, mm. `rate` and `move` command the field; `counts` are the steps that it was sent, `position`
    (mm) is where the carriage really is, `lost` how many steps lie between.
    """

    def __init__(self, parameters: StepperParameters, step: float, start: float = 0.0):
        self.parameters, self.step = parameters, step
        self.lost = 0  # steps: sent, and not made
        self._now = start
        self._field = self._rotor = self._speed = 0.0  # steps, steps, steps/s
        self._rate = 0.0  # steps/s of the field
        self._end: float | None = 0.0  # steps: where the field stands after all moves; None: it turns at a rate
        self._commands: deque[tuple[float, float, float | None]] = deque()  # from when, steps/s, field then (or None)
        p, s = parameters, step
        self._torque, self._friction, self._weight = p.torque / s, p.friction / s, p.weight / s
        self._corner, self._span = p.corner / s, (p.no_torque - p.corner) / s

    @property
    def now(self) -> float:
        """The instant up to which it has moved, s."""
        return self._now

    @property
    def counts(self) -> int:
        """Steps sent: all that a unit without an encoder knows of its position."""
        return round(self._field)

    @property
    def position(self) -> float:
        """Where the carriage is, mm."""
        return self._rotor * self.step * self.parameters.scale

    @property
    def moving(self) -> bool:
        """Whether anything moves, or is going to."""
        return bool(self._commands) or self._rate != 0.0 or self._speed != 0.0

    def rate(self, speed: float, at: float) -> None:
        """The field turns at `speed` (mm/s) from the instant `at` on; what was commanded for later is dropped."""
        self.advance(at)
        self._commands.clear()
        self._rate, self._end = speed / self.step, None
        if speed == 0.0:
            self._end = self._field = float(round(self._field))

    def move(self, steps: int, at: float, time: float) -> None:
        """`steps` whole steps, evenly over `time` s from the instant `at` on, then standstill.

        Moves may be commanded ahead; one that begins while another goes on takes over what that has not made yet.
        """
        while self._commands and self._commands[-1][0] > at - _NOW:
            self._commands.pop()
        begun = self._field_at(at)
        self._end = steps + (float(round(begun)) if self._end is None else self._end)
        self._commands.append((at, (self._end - begun) / time, None))
        self._commands.append((at + time, 0.0, self._end))

    def _field_at(self, at: float) -> float:
        field, rate, now = self._field, self._rate, self._now
        recent = []  # since the field was last known: thousands may wait where nobody looks at the axis
        for command in reversed(self._commands):
            if command[0] <= at:
                recent.append(command)
                if command[2] is not None:
                    break
        for instant, next_rate, known in reversed(recent):
            field += rate * (instant - now)
            field = field if known is None else known
            rate, now = next_rate, instant
        return field + rate * max(0.0, at - now)

    def stop(self, at: float) -> None:
        """No more pulses from the instant `at` on."""
        self.rate(0.0, at)

    def advance(self, until: float) -> float:
        """Move on to the instant `until`; the carriage's position there, mm. Earlier instants change nothing."""
        while self._commands and self._commands[0][0] <= until:
            instant, rate, known = self._commands.popleft()
            self._follow(instant - self._now)
            self._now = max(self._now, instant)
            self._rate = rate
            if known is not None:
                self._field = known
        self._follow(until - self._now)
        self._now = max(self._now, until)
        return self.position

    def _follow(self, time: float) -> None:
        """The field turns at a constant rate for `time` s, and the rotor after it."""
        rate = self._rate
        if time <= 0.0 or (rate == 0.0 and self._speed == 0.0 and self._is_with_field()):
            return
        steps = max(1, ceil(time / SUBSTEP - 1e-9))
        dt = time / steps
        for left in range(steps, 0, -1):
            if abs(self._speed - rate) < _SAME and self._is_with_field() and self._holds(rate):
                self._field += rate * dt * left
                self._rotor = self._field - self.lost
                self._speed = rate
                return
            self._field += rate * dt
            self._substep(rate, dt)

    def _is_with_field(self) -> bool:
        return abs(self._field - self.lost - self._rotor) < _SAME

    def _substep(self, rate: float, dt: float) -> None:
        speed, behind = self._speed, self._field - self.lost - self._rotor
        wanted = rate + behind / _TIGHT
        low, high = self._accelerations(speed, wanted)
        change = min(max(wanted - speed, low * dt), high * dt)
        if abs(wanted - speed) < 1.0 and low <= 0.0 <= high:
            change = wanted - speed
        self._speed = speed + change
        self._rotor += 0.5 * (speed + self._speed) * dt
        behind = self._field - self.lost - self._rotor
        while abs(behind) > HOLDS:
            slip = int(copysign(SLIPS, behind))
            self.lost += slip
            behind -= slip
        if abs(behind) < 1e-3 and abs(self._speed - rate) < 1.0:
            self._rotor, self._speed = self._field - self.lost, rate

    def _holds(self, rate: float) -> bool:
        low, high = self._accelerations(rate, rate)
        return low <= 0.0 <= high

    def _accelerations(self, speed: float, wanted: float) -> tuple[float, float]:
        """The lowest and highest acceleration of the rotor, steps/s²."""
        fast = abs(speed)
        torque = self._torque
        if fast > self._corner:
            torque *= max(0.0, 1.0 - (fast - self._corner) / self._span)
        way = speed if speed != 0.0 else wanted
        load = self._weight + (copysign(self._friction, way) if way else 0.0)
        return -torque - load, torque - load
