"""Values of a student's making, shown and copied without trusting their own methods."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Any

import numpy as np

from rds.core.blame import student_error
from rds.core.errors import ContractError

_MOST = 100_000  # values of a state that are looked at
_PARTS: dict[type, Callable[[Any], Iterable[Any]]] = {
    list: list.__iter__,
    tuple: tuple.__iter__,
    deque: deque.__iter__,
    dict: dict.values,
}


def shown(value: Any, length: int = 80) -> str:
    """Its text, on one line and not longer than `length` characters."""
    if _is_vast(value):
        return f"a {type(value).__name__} that holds more than {_MOST} others"
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a class of the student's may fail to print itself
        text = f"a {type(value).__name__}"
    return text if len(text) <= length else text[: length - 1] + "…"


def _is_vast(value: Any) -> bool:
    """Whether its text would be without end: of what holds a few parts that hold each other many times."""
    left = [value]
    for _ in range(_MOST):
        if not left:
            return False
        each = left.pop()
        if (parts := _PARTS.get(type(each))) is not None:
            left.extend(part for part in parts(each) if type(part) in _PARTS)
    return bool(left)


def is_table(values: Any) -> bool:
    """Whether it holds rows and columns of numbers, as [[0, 0], [0, 0]] does; one row or column alone is a list."""
    parts = list(values) if isinstance(values, list | tuple) or (isinstance(values, np.ndarray) and values.ndim) else []
    sizes = [len(part) if isinstance(part, list | tuple) else np.size(part) for part in parts]
    return len(sizes) > 1 and max(sizes) > 1


def is_masked(value: Any) -> bool:
    """Whether it is one of numpy's masked arrays, or a list of them, with a number that is masked: that is no answer.

    `np.asarray` would take the number under the mask for one.
    """
    parts = value if isinstance(value, list | tuple) else (value,)
    for part in parts:
        if type(part) is not float and type(part) is not np.ndarray and isinstance(part, np.ndarray):
            mask = getattr(part, "mask", False)  # of another class this may be anything
            if not callable(mask) and np.any(mask):
                return True
    return False


def own_copy(value: Any, what: str, where: str | None = None) -> Any:
    """A copy that shares nothing with `value`, which is the `what` of the error's sentence.

    Raises ContractError for what cannot be copied: a lock, an open file, a class of the student's that fails at it.
    """
    try:
        return copy.deepcopy(value)
    except Exception as error:
        said = f"{what} cannot be copied ({student_error(error)}); keep numbers, lists, dicts and arrays in it"
        raise ContractError(said, where) from error


def has_nan(value: Any) -> bool:
    """Whether any number in it is NaN, as far as it consists of lists, tuples, dicts and arrays.

    Each of them is looked through once, and by Python's own methods: it may hold itself, or be of a class whose methods
    fail. Beyond `_MOST` values it is not looked through.
    """
    left: deque[Any] = deque([value])
    seen: set[int] = set()
    for _ in range(_MOST):
        if not left:
            break
        each = left.popleft()
        kind = type(each)
        if issubclass(kind, np.ndarray):
            if each.dtype.kind in "fc" and bool(np.isnan(each).any()):
                return True
        elif issubclass(kind, float):
            if float.__ne__(each, each):
                return True
        elif issubclass(kind, np.floating):
            if each != each:
                return True
        elif id(each) not in seen and (parts := next((_PARTS[own] for own in kind.__mro__ if own in _PARTS), None)):
            seen.add(id(each))
            left.extend(islice(parts(each), _MOST))
    return False
