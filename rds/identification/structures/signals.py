"""Units of a structure that follow those of its log: what it answers in, and what commands it.

The equations of the structures hold in any units. An axis with a position in degrees that is commanded in Nm has a gain
in (deg/s)/Nm, friction in deg/s and a dead zone in Nm. So a structure is made for the output and the command of a log:

    output     mm, deg, and the speeds mm/s and rev/min, where no position was logged
    command    V, A, N, Nm, %
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.identification.logs.log import RATES

VOLTS = "V"
COMMANDS = (VOLTS, "A", "N", "Nm", "%")
OUTPUTS = ("mm", "deg", *RATES)
SPEEDS = {"mm": "mm/s", "deg": "deg/s"} | {unit: unit for unit in RATES}  # of each output
ROTARY = ("deg", "rev/min")
# how many of an output's unit (of speed and acceleration, too) one metre, or one radian, is
PER_SI = {"mm": 1e3, "mm/s": 1e3, "deg": 180.0 / pi, "rev/min": 30.0 / pi}
# the position of which an output is the speed, and what the speed's numbers are multiplied by
POSITIONS = {"mm": ("mm", 1.0), "deg": ("deg", 1.0), "mm/s": ("mm", 1.0), "rev/min": ("deg", 6.0)}


def follow(unit: str, output: str, command: str) -> str:
    """A parameter's unit, stated for mm and V, for another output and command."""
    speed = SPEEDS[output]
    words = {
        "mm": output,
        "mm/s": speed,
        "V": command,
        "(mm/s)/V": f"({speed})/{command}",
        "(rev/min)/V": f"({speed})/{command}",
        "mm/s per mm/s": f"{speed} per {speed}",
    }
    return words.get(unit, unit)


def followed(table: Mapping[str, Quantity], output: str, command: str) -> dict[str, Quantity]:
    """The parameters with units that follow."""
    if (output, command) == ("mm", VOLTS):
        return dict(table)
    return {
        name: replace(
            quantity,
            unit=follow(quantity.unit, output, command),
            meaning=quantity.meaning.replace("voltage", "command") if command != VOLTS else quantity.meaning,
        )
        for name, quantity in table.items()
    }


def check_signals(name: str, outputs: Sequence[str], output: str, command: str) -> None:
    """InputError for an output or command that the structure does not have."""
    if output not in outputs:
        raise InputError(
            f"position is in {output}, and structure {name} takes {' or '.join(outputs)}; state the unit in a map "
            "beside the data, or choose the structure for it (axis-inertia for a mass that turns, spindle for a speed)"
        )
    if command not in COMMANDS:
        raise InputError(f"command is in {command}, and structure {name} takes one of {', '.join(COMMANDS)}")
