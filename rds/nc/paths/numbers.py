"""The numbers that paths are made of: finite, with a unit in the message, within a kilometre."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import Quantity

FARTHEST = 1e6  # mm; beyond it a double has fewer decimals than a program prints, and the unit is wrong anyway

FEED_RATE = Quantity("feed rate along the path", "mm/s", above=0.0)
POSITIVE = Quantity("length", "mm", above=0.0)
NOT_NEGATIVE = Quantity("length", "mm", low=0.0)
COORDINATE = Quantity("coordinate", "mm")
ANGLE = Quantity("angle", "degrees")

# What a program has besides its path.
SPINDLE = Quantity("spindle speed, clockwise", "rev/min", above=0.0)
BLEND = Quantity("how far blended corners may be off the path", "mm", above=0.0)
HEIGHT = Quantity("z of rapid moves to and from the path; without it the tool feeds there", "mm")
DECIMALS = Quantity("decimals of coordinates in mm", low=1, high=9, default=4, whole=True)


def number(value: Any, name: str, owner: str, option: Quantity) -> float:
    """The value as a checked float; InputError says what it must be. Lengths end at a kilometre, as do angles at a
    million degrees."""
    checked = option.check(value, name, owner)
    if abs(checked) > FARTHEST:
        raise InputError(f"{owner}: {name} = {value!r} must be at most {FARTHEST:g} ({option.described})")
    return checked


def point(values: Sequence[float], name: str, owner: str, sizes: tuple[int, ...] = (2, 3)) -> tuple[float, ...]:
    """`values` as x, y, z in mm; a missing z is 0. InputError where there are too few, too many or no numbers."""
    try:
        given = tuple(values)
    except TypeError:
        given = ()
    if len(given) not in sizes or isinstance(values, str | bytes):
        words = " or ".join({2: "x, y", 3: "x, y, z"}[size] for size in sizes)
        raise InputError(f"{owner}: {name} = {values!r} must be {words} in mm")
    checked = tuple(
        number(value, f"{axis} of {name}", owner, COORDINATE) for axis, value in zip("xyz", given, strict=False)
    )
    return checked if len(checked) == 3 else (*checked, 0.0)


def point_text(point: Iterable[float]) -> str:
    """A point as messages show it."""
    return "(" + ", ".join(f"{value:g}" for value in point) + ")"
