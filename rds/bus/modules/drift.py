"""Clocks of virtual nodes that go wrong by a number that one can set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rds.core.errors import InputError
from rds.core.shared_quantities import CLOCK_DRIFT
from rds.machines.machine import Machine

_DRIFTS = "X:50,Y:-30"


def drifts(words: Any, machine: Machine) -> dict[str, float]:
    """Drifts in ppm by axis, from a table or from text. InputError for what is none."""
    if isinstance(words, str):
        pairs = [word.replace("=", ":").partition(":") for word in words.split(",") if word]
        if len({name.strip() for name, _, _ in pairs}) < len(pairs):
            raise InputError(f"drift = {words!r} names an axis twice")
        try:
            words = {name.strip(): float(value) for name, _, value in pairs}
        except ValueError:
            raise InputError(f"drift = {words!r} must be ppm by axis, as in {_DRIFTS}") from None
    if not isinstance(words, Mapping):
        raise InputError(f"drift = {words!r} must be ppm by axis, as in {_DRIFTS}")
    return {machine.axis(name).name: CLOCK_DRIFT.check(value, f"drift of {name}") for name, value in words.items()}


def drift_by_axis(words: Any, machine: Machine) -> dict[str, float]:
    """The drift of each axis's clock, ppm: as said, else as [axis.NAME.module] of the machine file says, else none."""
    said = drifts(words or {}, machine)
    return {name: said.get(name, float(axis.module.get("drift", 0.0))) for name, axis in machine.axes.items()}
