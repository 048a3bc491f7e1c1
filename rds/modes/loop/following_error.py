"""The run ends where an axis is too far from its reference, as LinuxCNC's does: FERROR and MIN_FERROR of [JOINT_n].

    allowed = max(min_ferror, ferror min(1, |v| / v_max))

with v the velocity of the reference and v_max the axis's largest: `ferror` at full speed, and less when slower, down to
`min_ferror`. A law of the wrong sign, a stuck axis or a loose encoder so ends at zero volts, and not at the end stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rds.core.quantities import Quantity, Table
from rds.core.types import Ending

LARGEST = Quantity("largest following error, at the axis's largest velocity", "axis unit", above=0.0)
FOLLOWING_ERROR = Table(
    "ends the run where the axis is too far from its reference (LinuxCNC's FERROR, MIN_FERROR)",
    {
        "ferror": LARGEST,
        "min_ferror": Quantity("largest following error at rest; by default ferror", "axis unit", above=0.0),
    },
    needed=("ferror",),
)


@dataclass(frozen=True)
class ErrorLimits:
    """How far an axis may be from its reference, in its unit: at rest, and at its largest velocity (unit/s)."""

    at_rest: float
    at_top_speed: float
    top_speed: float

    def at(self, velocity: float) -> float:
        """What is allowed at a velocity of the reference."""
        return max(self.at_rest, self.at_top_speed * min(1.0, abs(velocity) / self.top_speed))


@dataclass(frozen=True)
class Watched:
    """An axis that is watched: where its reference stands in a row, before its rates and what was measured."""

    name: str
    unit: str
    allowed: ErrorLimits
    place: int


class FollowingGuard:
    """The last of a run's laws: it takes the voltages away where an axis is too far off, and says how the run ends."""

    def __init__(self, axes: Sequence[Watched], voltages: Sequence[int], T: float):
        """`voltages` are the places, in axis order, of the commands that are voltages: drives stop by themselves."""
        self._axes, self._voltages, self._T = tuple(axes), tuple(voltages), T
        self._ending: tuple[Ending, str] | None = None

    def law(self, k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        """Look at the sample that the laws before have recorded in `row`."""
        for axis in self._axes:
            at = axis.place
            error = row[at] - row[at + 3]
            allowed = axis.allowed.at(row[at + 1])
            if self._ending is None and not abs(error) <= allowed:
                unit, speed = axis.unit, abs(row[at + 1])
                said = (
                    f"axis {axis.name} was {abs(error):.4g} {unit} from its reference at t = {k * self._T:.3f} s, and "
                    f"{allowed:.4g} {unit} are allowed at {speed:.4g} {unit}/s; look at the sign and the gains of the "
                    "controller and whether the axis moves, or allow more in [following_error]"
                )
                self._ending = Ending.FOLLOWING_ERROR, said
        if self._ending is not None:
            for i in self._voltages:
                voltages[i] = 0.0

    def over(self) -> tuple[Ending, str] | None:
        """How the run ends before its next sample, and why, if it does."""
        return self._ending
