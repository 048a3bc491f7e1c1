"""The controller of a module: PI or PID on encoder counts, with a pulse width as its output (oacs-thesis 7.2, C).

    u(n) = Kp e(n) + Ki s(n) + Kd (e(n) - e(n-1))/T,      s(n) = s(n-1) + T e(n),   limited to ±integral_limit

that is equations 7.20 to 7.24. The error e is what is left of the way, in counts, in the direction of the motion (the
thesis's text has desired minus actual position; its sample code has the reverse, which would drive away). The output
is limited to output_low..output_high, in duty: 0 to 255, of which 255 is the whole supply; the direction is another
wire. With output_low = 0 the axis is never braked by the motor: it coasts at the end. On its first iteration the
output is `kick`, which breaks the wiper motor loose.

The thesis's sample code has no T; with the thesis's 0.5 s the same gains differ by that factor. With T they mean the
same at any sample time, and the rules of table 11 apply.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite
from typing import NamedTuple

from rds.bus.modules.oacs.codes import DUTY, Parameter, Select
from rds.core.errors import InputError


@dataclass(frozen=True)
class Tuning:
    """What can be set of a module's controller; the defaults are the thesis's, where it has any."""

    controller: Select = Select.PID
    Kp: float = 1.5  # duty/count
    Ki: float = 1.5  # duty/(count s)
    Kd: float = 1.0  # duty s/count
    integral_limit: float = 200.0  # count s
    output_low: float = 0.0  # duty
    output_high: float = float(DUTY)  # duty
    kick: float = float(DUTY)  # duty, of the first iteration; 0: no kick
    sample_time: float = 0.5  # s
    tolerance: float = 0.0  # counts: the motion ends when no more is left

    def __post_init__(self) -> None:
        for parameter, name in FIELDS.items():
            value = getattr(self, name)
            low, high = RANGES[parameter]
            if not isinstance(value, int | float) or not isfinite(value) or not low <= value <= high:
                raise InputError(f"tuning parameter {name} = {value!r} must be a number from {low:g} to {high:g}")
        if not self.output_low < self.output_high:
            raise InputError(f"output_low = {self.output_low!r} must be less than output_high = {self.output_high!r}")
        if self.controller not in tuple(Select):
            raise InputError(f"controller = {self.controller!r} must be PI or PID")

    def with_controller(self, controller: Select) -> Tuning:
        """The same with another controller."""
        return replace(self, controller=controller)

    def with_parameter(self, parameter: Parameter, value: float) -> Tuning:
        """The same with one parameter changed; InputError if it cannot be so."""
        return replace(self, **{FIELDS[parameter]: value})  # type: ignore[arg-type]


MEANINGS = {  # of the fields of Tuning: unit and words; 255 duty are the whole supply voltage
    "controller": ("", "PI or PID"),
    "Kp": ("duty/count", "proportional gain"),
    "Ki": ("duty/(count s)", "integral gain"),
    "Kd": ("duty s/count", "derivative gain"),
    "integral_limit": ("count s", "the integral stays within ± this"),
    "output_low": ("duty", "least output; 0: the motor never brakes, the axis coasts"),
    "output_high": ("duty", "most output; 255 is the whole supply voltage"),
    "kick": ("duty", "output of the first iteration; 0: no kick"),
    "sample_time": ("s", "from one iteration to the next"),
    "tolerance": ("count", "a motion ends when no more is left"),
}
FIELDS = {
    Parameter.KP: "Kp",
    Parameter.KI: "Ki",
    Parameter.KD: "Kd",
    Parameter.INTEGRAL_LIMIT: "integral_limit",
    Parameter.OUTPUT_LOW: "output_low",
    Parameter.OUTPUT_HIGH: "output_high",
    Parameter.KICK: "kick",
    Parameter.SAMPLE_TIME: "sample_time",
    Parameter.TOLERANCE: "tolerance",
}
RANGES = {
    Parameter.KP: (0.0, 1e6),
    Parameter.KI: (0.0, 1e6),
    Parameter.KD: (0.0, 1e6),
    Parameter.INTEGRAL_LIMIT: (0.0, 1e9),
    Parameter.OUTPUT_LOW: (-DUTY, DUTY),
    Parameter.OUTPUT_HIGH: (-DUTY, DUTY),
    Parameter.KICK: (0.0, DUTY),
    Parameter.SAMPLE_TIME: (0.001, 10.0),
    Parameter.TOLERANCE: (0.0, 1e6),
}


class Memory(NamedTuple):
    """What the controller remembers; start with `Memory()`."""

    integral: float = 0.0  # count s
    last: float = 0.0  # counts
    iterations: int = 0


def step(error: float, memory: Memory, tuning: Tuning) -> tuple[float, Memory]:
    """Output (duty, signed in the direction of the motion) and next memory, for an error in counts."""
    limit = tuning.integral_limit
    integral = min(max(memory.integral + error * tuning.sample_time, -limit), limit)
    output = tuning.Kp * error + tuning.Ki * integral
    if tuning.controller == Select.PID and memory.iterations:  # no slope before the second sample
        output += tuning.Kd * (error - memory.last) / tuning.sample_time
    output = min(max(output, tuning.output_low), tuning.output_high)
    if memory.iterations == 0 and tuning.kick:
        output = min(tuning.kick, tuning.output_high)
    return output, Memory(integral, error, memory.iterations + 1)
