"""Values of a student's making, shown and copied without trusting their own methods."""

from __future__ import annotations

import copy
from typing import Any

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
