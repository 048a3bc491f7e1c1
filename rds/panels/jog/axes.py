"""What of a machine can be moved by hand, its axes and its spindle, with the limits that hold then."""

from __future__ import annotations

from dataclasses import dataclass

from rds.core.types import SPINDLE_UNIT
from rds.machines.machine import Axis, Machine

_REST = 0.08  # s from the highest speed to rest at most
_RISE = 5.0  # time constants from rest to the highest speed, where the machine gives no acceleration


@dataclass(frozen=True)
class JogAxis:
    """A position axis; units of the axis, s."""

    name: str
    unit: str
    travel: tuple[float, float]
    speed: float  # the most
    acceleration: float
    braking: float  # deceleration to rest, when it is let go
    resolution: float

    def end(self, place: float, direction: int) -> float:
        """Where a motion in this direction ends; an axis that stands beyond its travel goes no further out."""
        low, high = self.travel
        return max(place, high) if direction > 0 else min(place, low)


@dataclass(frozen=True)
class JogSpindle:
    """A spindle; rev/min, s."""

    name: str
    speeds: tuple[float, float]  # lowest and highest; a negative one turns the other way
    acceleration: float
    resolution: float

    @property
    def unit(self) -> str:
        """Of its speed."""
        return SPINDLE_UNIT


def jog_axes(machine: Machine) -> dict[str, JogAxis]:
    """The position axes whose speed is known: by their limits, or by the gain of their model."""
    return {axis.name: made for axis in machine.axes.values() if (made := _jog_axis(axis, machine)) is not None}


def jog_spindles(machine: Machine) -> dict[str, JogSpindle]:
    """The spindles of `machine`."""
    return {
        axis.name: JogSpindle(
            name=axis.name,
            speeds=axis.travel,
            acceleration=max(map(abs, axis.travel)) / (_RISE * (axis.model.get("tau") or 0.1)),
            resolution=axis.resolution,
        )
        for axis in machine.axes.values()
        if axis.unit == SPINDLE_UNIT
    }


def _jog_axis(axis: Axis, machine: Machine) -> JogAxis | None:
    tau, K = axis.model.get("tau"), axis.model.get("K")
    if axis.unit == SPINDLE_UNIT:
        return None
    if axis.limits:
        speed, acceleration = axis.limits.velocity, axis.limits.acceleration
    elif tau and K:
        speed = 0.5 * K * machine.converter.range
        acceleration = speed / (_RISE * tau)
    else:
        return None
    return JogAxis(
        name=axis.name,
        unit=axis.unit,
        travel=axis.travel,
        speed=speed,
        acceleration=acceleration,
        braking=max(acceleration, speed / _REST),
        resolution=axis.resolution,
    )
