"""What the axes can do: the `[axis.NAME.limits]` of a machine, as arrays over X Y Z A B C."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rds.core.errors import InputError
from rds.interpolators.motion.segments import AXES
from rds.machines import Machine


@dataclass(frozen=True)
class Limits:
    """Velocity, acceleration and jerk of the axes X Y Z A B C: mm/s, mm/s², mm/s³ (degrees for A B C).

    Arrays of 6; 0 stands for an axis that the machine does not have, and may not move.
    """

    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray

    @classmethod
    def of(cls, machine: Machine) -> Limits:
        """Those of a machine's axes that are called X, Y, Z, A, B or C. InputError for one without limits."""
        if not hasattr(machine, "axes"):
            raise InputError(f"{machine!r:.60} is no machine; load one, as in Limits.of(load_machine('mini-cnc'))")
        axes: dict[str, tuple[float, float, float]] = {}
        for name, axis in machine.axes.items():
            if name in AXES:
                if axis.limits is None:
                    raise InputError(
                        f"axis {name} has no limits, without which motion can't be planned; "
                        f"add [axis.{name}.limits] with velocity, acceleration and jerk",
                        machine.path,
                    )
                axes[name] = (axis.limits.velocity, axis.limits.acceleration, axis.limits.jerk)
        return cls.from_axes(axes)

    @classmethod
    def from_axes(cls, axes: Mapping[str, tuple[float, float, float]]) -> Limits:
        """From (velocity, acceleration, jerk) by axis name. InputError for a name or a value that cannot be."""
        table = np.zeros((3, len(AXES)))
        for name, values in axes.items():
            if name not in AXES:
                raise InputError(f"no axis {name!r} can be planned for; axes are {', '.join(AXES)}")
            if not all(np.isfinite(value) and value > 0.0 for value in values):
                raise InputError(
                    f"axis {name}: velocity, acceleration, jerk = {values} must each be more than 0 and finite"
                )
            table[:, AXES.index(name)] = values
        return cls(*table)

    @property
    def present(self) -> np.ndarray:
        """Which of the six axes the machine has."""
        return self.velocity > 0.0
