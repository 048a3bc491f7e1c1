"""The axis that turns, in the form of its inertia: what a drive's torque moves, in kg·m² and Nm.

    J ω' + B ω + T_c sign(ω) + offset = k u                                (ω in rad/s, u the command)

k is the torque that one unit of the command makes: the motor constant in Nm/A where a current is commanded, 1 where the
command is a torque in Nm. It is given with the log (`torque_gain` in the map). With the option `per-direction` friction
is free for each direction. The output is the angle in degrees, or the speed in rev/min where no angle was logged.
"""

from __future__ import annotations

from collections.abc import Sequence

from rds.identification.structures.axis_mass import GAIN, OPTIONS, Form, made_of
from rds.identification.structures.structure import Structure

__all__ = ["OPTIONS", "OUTPUTS", "make"]

OUTPUTS = ("deg", "rev/min")
_OWN = {
    "M": "J",
    "F_v": "B",
    "F_c": "T_c",
    **{f"F_{kind}_{side}": f"{own}_{side}" for kind, own in (("v", "B"), ("c", "T_c")) for side in ("plus", "minus")},
    GAIN: "torque_gain",
}
ROTARY = Form("axis-inertia", _OWN, "Nm", "Nm·s/rad", "kg·m²", "inertia", "torque")


def make(options: Sequence[str] = (), output: str = "deg", command: str = "V") -> Structure:
    """The structure `axis-inertia`, with friction free per direction if `options` say so."""
    return made_of(ROTARY, options, output, command)
