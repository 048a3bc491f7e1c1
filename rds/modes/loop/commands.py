"""What the loop hands to an axis at each sample: a voltage, or a target for a loop that the axis's drive closes."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from math import inf, isfinite
from typing import Any

from rds.core.errors import ContractError
from rds.machines.converter import as_voltage


class Command(Enum):
    """A kind of command: its quantity, what follows the axis's unit in its own, and the loop that the drive closes."""

    VOLTAGE = ("voltage", "", "")
    VELOCITY = ("velocity", "/s", "velocity loop")
    POSITION = ("position", "", "position loop")
    PROFILE = ("position of a profile", "", "profile and position loop")

    @property
    def quantity(self) -> str:
        """For people."""
        return self.value[0]

    @property
    def loop(self) -> str:
        """The loop that the axis's drive closes, for people; "" for none."""
        return self.value[2]

    @property
    def acting(self) -> str:
        """How the name of the column with what acted on the axis ends."""
        return "voltage" if self is Command.VOLTAGE else "target"

    def unit(self, axis_unit: str) -> str:
        """Of the command of an axis whose position is in `axis_unit`."""
        if self is Command.VOLTAGE:
            return "V"
        return axis_unit if axis_unit == "rev/min" else axis_unit + self.value[1]


def limiter(command: Command, most: float, unit: str) -> Callable[[Any], float]:
    """The function that checks a target and keeps it within ±`most` (infinite: as it is), in `unit`.

    ContractError for one that is no finite number.
    """

    def limit(value: Any) -> float:
        try:
            number = value if type(value) is float else as_voltage(value)
        except ContractError:
            number = inf
        if not isfinite(number):
            told = f"control() gave {value!r:.200} as the {command.quantity}"
            raise ContractError(f"{told}; it must be one finite number in {unit}")
        return min(max(number, -most), most)

    return limit
