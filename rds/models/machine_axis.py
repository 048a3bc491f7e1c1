"""The machine's own axis: what a student's model is compared against.

Motor and carriage, with the velocity v in mm/s (rev/min for a spindle), the voltage u in V:

    τ v' + v = K u - F(v)                                                      (linear axis of the paper)
    F(v) = F± (1 + s exp(-(v/v_s)²)) + b± v,     F+, b+ for v > 0, F- (negative), b- for v < 0

F± is Coulomb friction per direction, s the Stribeck part, b± the viscous part. At rest the axis sticks while
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
from dataclasses import dataclass

from rds.core.errors import InputError
from rds.core.options import check_known
from rds.core.quantities import Quantity
from rds.models.machine_motion import moved, pull_of

PARAMETERS = {
    "tau": Quantity("time constant", "s", above=0.0),
    "K": Quantity("gain", "(mm/s)/V", above=0.0),
    "friction_plus": Quantity("Coulomb friction forward, at high speed", "mm/s", low=0.0),
    "friction_minus": Quantity("Coulomb friction backward, at high speed", "mm/s", high=0.0),
    "viscous": Quantity("speed lost to viscous friction", "(mm/s) per mm/s", low=0.0),
    "viscous_difference": Quantity(
        "how much more speed viscous friction takes while moving backward", "(mm/s) per mm/s"
    ),
    "stribeck": Quantity("extra friction at standstill, as a fraction of that at high speed", low=0.0),
    "stribeck_velocity": Quantity("speed at which it has gone", "mm/s", above=0.0),
    "backlash": Quantity("play between motor and encoder, its whole width", "mm", low=0.0),
    "delay": Quantity("time from the command frame to the amplifier's output", "s", 0.0, 1000.0),
    "offset": Quantity("what the amplifier adds to the voltage", "V"),
    "dead_zone": Quantity("half width of the dead zone: smaller voltages do nothing", "V", low=0.0),
}


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
    viscous_difference: float = 0.0  # (mm/s) per mm/s: viscous friction backward less that forward

    def __post_init__(self) -> None:
        for name, declared in PARAMETERS.items():
            declared.check(getattr(self, name), name, "machine parameter")
        if self.viscous + self.viscous_difference < 0.0:
            raise InputError(
                f"machine parameter viscous_difference = {self.viscous_difference:g} must be at least "
                f"-{self.viscous:g} (minus viscous): friction would drive the axis backward"
            )

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
            self.viscous_difference,
        )

    @classmethod
    def from_table(cls, table: Mapping[str, float], where: str | None = None) -> MachineParameters:
        """From a TOML table; InputError for an unknown or missing key or a value that can't be."""
        try:
            check_known(table, PARAMETERS, "the machine's axis")
            for key in ("tau", "K"):
                if key not in table:
                    raise InputError(f"machine parameter {key} is missing; give it ({PARAMETERS[key].described})")
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
