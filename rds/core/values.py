"""Values of a student's making, shown and copied without trusting their own methods."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np

from rds.core.blame import student_error
from rds.core.errors import ContractError


def shown(value: Any, length: int = 80) -> str:
    """Its text, on one line and not longer than `length` characters."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a class of the student's may fail to print itself
        text = f"a {type(value).__name__}"
    return text if len(text) <= length else text[: length - 1] + "…"


def own_copy(value: Any, what: str, where: str | None = None) -> Any:
    """A copy that shares nothing with `value`, which is the `what` of the error's sentence.

    Raises ContractError for what cannot be copied: a lock, an open file, a class of the student's that fails at it.
    """
    try:
        return copy.deepcopy(value)
    except Exception as error:
        said = f"{what} cannot be copied ({student_error(error)}); keep numbers, lists, dicts and arrays in it"
        raise ContractError(said, where) from error


def has_nan(value: Any, depth: int = 0) -> bool:
    """Whether any number in it is NaN, as far as it consists of lists, tuples, dicts and arrays."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "fc" and bool(np.isnan(value).any())
    if isinstance(value, float | np.floating):
        return bool(value != value)
    if depth > 40:
        return False
    if isinstance(value, Mapping):
        return any(has_nan(part, depth + 1) for part in value.values())
    return isinstance(value, list | tuple | deque) and any(has_nan(part, depth + 1) for part in value)
