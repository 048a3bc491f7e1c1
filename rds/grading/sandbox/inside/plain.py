"""A submission's values as JSON can carry them: numbers, texts, lists and dicts, bounded."""

from __future__ import annotations

from math import isfinite
from numbers import Real
from typing import Any

import numpy as np

DEEPEST = 12
MOST = 20_000  # single values
LARGEST_INTEGER = 10**299  # as long as one that frames take


class NotPlain(ValueError):
    """A value that is none; the text says which."""


def plain(value: Any) -> Any:
    """`value` with tuples and arrays as lists. NotPlain for NaN, infinity, objects, and what is too large or deep."""
    return _plain(value, 0, [MOST])


def _plain(value: Any, depth: int, left: list[int]) -> Any:
    left[0] -= 1
    if left[0] < 0:
        raise NotPlain(f"it holds more than {MOST} values")
    if depth > DEEPEST:
        raise NotPlain(f"it has more than {DEEPEST} lists inside each other")
    if value is None or type(value) is bool:
        return value
    if type(value) is str:
        try:
            value.encode()
        except UnicodeEncodeError:
            raise NotPlain("it holds a text with half a character (a surrogate), which no file can hold") from None
        return value
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind not in "fiub":
            raise NotPlain(f"it holds an array of {value.dtype}")
        if value.size > MOST:
            raise NotPlain(f"it holds more than {MOST} values")
        value = value.tolist()
    if type(value) is int and abs(value) > LARGEST_INTEGER:
        raise NotPlain("it holds an integer of more than 300 digits")
    if type(value) in (int, float, bool):
        if not isfinite(value):
            raise NotPlain(f"it holds {value!r}")
        return value
    if isinstance(value, Real):  # as a Fraction, or numpy's longdouble, which `tolist` leaves as it is
        try:
            return _plain(float(value), depth, left)
        except OverflowError:
            raise NotPlain(f"it holds a {type(value).__name__} beyond what a float can be") from None
    if isinstance(value, list | tuple):
        return [_plain(part, depth + 1, left) for part in value]
    if isinstance(value, dict):
        if not all(type(key) is str for key in value):
            raise NotPlain("it holds a dict whose keys are not all texts")
        return {_plain(key, depth, left): _plain(part, depth + 1, left) for key, part in value.items()}
    raise NotPlain(f"it holds a {type(value).__name__}")
