"""The rows of an interpolator, taken one by one and read as numbers."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rds.checks import clauses
from rds.checks.allowance import Allowance
from rds.checks.paths import name_of
from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import RdsError
from rds.core.geometry import length
from rds.core.types import Segment, Source
from rds.core.values import is_masked, shown

_ROWS_PER_ROW = 10  # how many times more rows than the feed rate asks for are still a slow start and stop
_SPARE_ROWS = 5000
_REMEDY = "yield one row for each sample, as in `yield position, velocity, acceleration`"


@dataclass
class Trace:
    """What came of one segment: `rows` of shape (rows, 3, axes), or the clause and message of its fault."""

    segment: Segment
    rows: np.ndarray
    ns: list[int] = field(default_factory=list)  # per row
    fault: tuple[str, str] | None = None
    refused: bool = False  # the code itself said no, rather than fail by accident
    complete: bool = True


Interpolate = Callable[..., Any]


def trace(
    interpolate: Interpolate, segment: Segment, T: float, params: dict[str, Any], source: Source, budget: float
) -> Trace:
    """Take all rows of `segment` at the sample period `T` (s), in about `budget` s at most."""
    taken: list[np.ndarray] = []
    result = Trace(segment, np.empty((0, 3, len(segment.start))))
    most = _ROWS_PER_ROW * int(length(segment) / segment.feed_rate / T) + _SPARE_ROWS
    try:
        with Allowance(budget) as allowance:
            rows = iterate(interpolate(segment, T, params))
            if isinstance(rows, str):
                result.fault = (clauses.ROWS, f"for {name_of(segment)} interpolate() returned {rows}")
                return result
            while True:
                started = time.perf_counter_ns()
                try:
                    row = next(rows)
                except StopIteration:
                    break
                result.ns.append(time.perf_counter_ns() - started)
                values = row_of(row, len(segment.start))
                if isinstance(values, tuple):
                    result.fault = (values[0], f"row {len(taken)} of {name_of(segment)} is {shown(row)}; {values[1]}")
                    break
                taken.append(values)
                if len(taken) > most:
                    said = f"{name_of(segment)} of {length(segment):.1f} mm at {segment.feed_rate:g} mm/s has no end"
                    remedy = "end the loop at the segment's end"
                    result.fault = (clauses.ENDS, f"{said} after {len(taken)} rows of {T:g} s; {remedy}")
                    break
                if allowance.is_spent():
                    result.complete = False
                    break
    except STUDENT_ERRORS as error:
        said = student_error(error, source)
        result.fault = (clauses.RUNS, f"interpolate() failed for {name_of(segment)}: {said}")
        result.refused = not taken and _is_refusal(error, segment)
    result.rows = np.array(taken) if taken else result.rows
    if not taken and result.fault is None:
        result.fault = (clauses.ROWS, f"for {name_of(segment)} it yields no row at all; {_REMEDY}")
        result.refused = True
    return result


def alternate(
    interpolate: Interpolate, segments: tuple[Segment, ...], T: float, params: Mapping[str, Any], counts: list[int]
) -> list[np.ndarray]:
    """Rows of several segments taken in turn, `counts` of each: shape (rows, 3, axes) each."""
    params = copy.deepcopy(dict(params))
    iterators = [iterate(interpolate(segment, T, params)) for segment in segments]
    rows: list[list[np.ndarray]] = [[] for _ in segments]
    for k in range(max(counts)):
        for iterator, own, segment, count in zip(iterators, rows, segments, counts, strict=True):
            if k < count and not isinstance(iterator, str):
                values = row_of(next(iterator, None), len(segment.start))
                own.append(np.full((3, len(segment.start)), np.nan) if isinstance(values, tuple) else values)
    return [np.array(own) for own in rows]


def iterate(answer: Any) -> Iterator[Any] | str:
    """The rows of what interpolate() returned; a text that says what it returned instead, with the remedy."""
    if answer is None:
        return f"nothing; {_REMEDY}"
    if isinstance(answer, tuple) and len(answer) == 3 and all(np.ndim(part) == 2 for part in answer):
        return f"three whole arrays; {_REMEDY}, here `yield from zip(position, velocity, acceleration)`"
    if isinstance(answer, str | bytes | Mapping) or not hasattr(answer, "__iter__"):
        return f"{shown(answer)}; {_REMEDY}"
    return iter(answer)


def row_of(row: Any, axes: int) -> np.ndarray | tuple[str, str]:
    """A row as an array of shape (3, axes), or the clause and the remedy if it is none."""
    if not isinstance(row, tuple | list | np.ndarray) or len(row) != 3:
        return clauses.ROWS, _REMEDY
    if is_masked(row):
        return clauses.FINITE, "a number that is masked is none; fill it, or yield plain arrays"
    try:
        values = np.array([np.array(part, ndmin=1) for part in row])
    except ValueError:
        return clauses.AXES, f"position, velocity and acceleration are {axes} numbers each, one for each axis"
    if values.dtype.kind not in "fiu":
        return clauses.ROWS, f"position, velocity and acceleration are {axes} numbers each, one for each axis"
    if values.shape != (3, axes):
        return clauses.AXES, f"position, velocity and acceleration are {axes} numbers each, one for each axis"
    if not np.logical_and.reduce(np.isfinite(values), axis=None):  # as `all`, which is written in Python
        return clauses.FINITE, "look for a division by zero, a root or a logarithm"
    return values.astype(float)


def _is_refusal(error: BaseException, segment: Segment) -> bool:
    if isinstance(error, AttributeError):  # it asks a line for its centre
        return error.obj is segment
    return isinstance(error, NotImplementedError | ValueError | TypeError | RdsError)
