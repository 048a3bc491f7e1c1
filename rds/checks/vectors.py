"""What a model's answers must be: one finite number for each state, and one for the output."""

from __future__ import annotations

from typing import Any

import numpy as np

from rds.checks import clauses
from rds.core.values import shown


def vector_of(answer: Any) -> np.ndarray | None:
    """The numbers in `answer`, one or an array or sequence of them, as the models' runtime reads it; None if none."""
    try:
        if isinstance(answer, np.ndarray | np.number | int | float) and not isinstance(answer, bool):
            parts = [np.asarray(answer)]
        elif isinstance(answer, list | tuple):
            parts = [np.asarray(part) for part in answer]
        else:
            return None
    except ValueError:  # a part of parts of different lengths
        return None
    if not parts or any(part.dtype.kind not in "fiu" for part in parts):
        return None
    return np.concatenate([part.astype(float).ravel() for part in parts])


def vector_fault(answer: Any, n: int) -> tuple[str, str, str] | None:
    """Clause, what was returned and the remedy, if `answer` is not `n` finite numbers."""
    vector = vector_of(answer)
    count = f"{n} number{'s' if n != 1 else ''}, as initial_state has"
    if vector is None:
        if answer is None:
            return clauses.SHAPE, "nothing", f"end it with `return`, and {count}"
        return clauses.SHAPE, shown(answer), f"return a list of {count}"
    if vector.size != n:
        said = f"{vector.size} value{'s' if vector.size != 1 else ''}, {shown(answer)},"
        return clauses.SHAPE, said, f"return a list of {count}"
    if not np.isfinite(vector).all():
        return clauses.FINITE, shown(answer), "look for a division by zero, a root or a logarithm"
    return None


def is_ragged(answer: Any) -> bool:
    """Whether numbers and arrays stand side by side in it, as in [x[1], K*u]: python-control refuses that."""
    if not isinstance(answer, list | tuple):
        return False
    return len({np.ndim(part) for part in answer}) > 1


def output_fault(answer: Any) -> tuple[str, str, str] | None:
    """Clause, what was returned and the remedy, if `answer` is not one finite number, alone or in an array."""
    try:
        values = np.asarray(answer)
    except ValueError:
        values = np.empty(0, dtype=object)
    if values.size != 1 or values.dtype.kind not in "fiu":
        return clauses.OUTPUT, shown(answer), "return one number, what the encoder sees, as in `return x[0]`"
    if not np.isfinite(values).all():
        return clauses.OUTPUT, shown(answer), "look for a division by zero, a root or a logarithm"
    return None
