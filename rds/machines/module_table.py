"""The `[axis.NAME.module]` table of a machine's file: what a distributed module knows of itself, and its board does.

Only modules that tell the host what they are (dialect oacs) need it; what it leaves out follows from the axis.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from rds.core.errors import InputError

KINDS = ("translational", "rotary", "tool")
TEXTS = ("board", "kind", "letter", "kind_text", "type_text", "joint")
SIGNED = ("initial", "start")  # positions, in the axis's unit
UNSIGNED = (
    *("accuracy", "repeatability", "counts_per_unit", "least_speed", "clockwise_speed", "counterclockwise_speed"),
    *("supply", "overtravel", "debounce", "response_call", "response_download", "current_start", "current_run"),
    *("interrupt_service", "interrupt_pause", "interrupt_every"),
)
WHOLE = ("counts_per_turn",)
READINGS = ("accelerometer", "vibration")  # of three channels, 10 bits each
KEYS = (*TEXTS, *SIGNED, *UNSIGNED, *WHOLE, *READINGS, "matrix", "switches")


def module_table(table: Any, place: str) -> dict[str, Any]:
    """The table, its numbers as floats and its lists as tuples. InputError naming `place` for what cannot be.

    Whether the values make a module (a matrix that is a motion, a letter...) is the dialect's business.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"module = {table!r} must be a table", place)
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in KEYS:
            raise InputError(f"unknown key {key!r}; known keys: {', '.join(sorted(KEYS))}", place)
        values[key] = _value(key, value, place)
    return values


def _value(key: str, value: Any, place: str) -> Any:
    if key in TEXTS:
        if not isinstance(value, str) or (key == "kind" and value not in KINDS):
            wanted = f"one of {', '.join(KINDS)}" if key == "kind" else "text"
            raise InputError(f"{key} = {value!r} must be {wanted}", place)
        return value
    if key == "switches":
        if not isinstance(value, bool):
            raise InputError(f"switches = {value!r} must be true or false", place)
        return value
    if key == "matrix":
        if not (isinstance(value, list) and len(value) == 4 and all(_is_row(row, 4) for row in value)):
            raise InputError(f"matrix = {value!r} must be 4 rows of 4 numbers", place)
        return tuple(tuple(map(float, row)) for row in value)
    if key in READINGS:
        if not (_is_row(value, 3) and all(isinstance(part, int) and 0 <= part < 1024 for part in value)):
            raise InputError(f"{key} = {value!r} must be three whole numbers from 0 to 1023", place)
        return tuple(value)
    if key in WHOLE:
        if not (_is_number(value) and isinstance(value, int) and value >= 0):
            raise InputError(f"{key} = {value!r} must be a whole number of at least 0", place)
        return value
    if not _is_number(value) or (key in UNSIGNED and value < 0):
        raise InputError(f"{key} = {value!r} must be a number{' of at least 0' if key in UNSIGNED else ''}", place)
    return float(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)


def _is_row(row: Any, length: int) -> bool:
    return isinstance(row, list) and len(row) == length and all(map(_is_number, row))
