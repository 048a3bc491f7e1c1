"""An interpolator with its parameters: from the library or from a user's file, and its rows as arrays."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from math import dist
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import ContractError, InputError
from rds.core.geometry import length
from rds.core.load import StudentFile, from_function, load_student
from rds.core.options import read_options
from rds.core.quantities import listed, shortened
from rds.core.signature import form
from rds.core.types import ArcSegment, Segment, Source
from rds.core.values import is_masked
from rds.interpolators import DEFAULT, LIBRARY
from rds.interpolators.division import Method, check_steps
from rds.interpolators.reference_word import Steps, steps
from rds.interpolators.segment import checked

Rows = Iterator[tuple[np.ndarray, ...]]
_MOST = 2_000_000  # rows of a segment, which are held in memory
_ROWS_PER_ROW, _SPARE_ROWS = 10, 5000  # a slow start and stop are still allowed
_LEAST_SHARE = 0.5  # of a segment's length that its rows must go: less has left out a part of it
_POINT = 0.1  # mm: what is shorter may be less than the steps of an interpolator


@dataclass(frozen=True)
class Interpolator:
    """`function(segment, T, params)` with its `params`.

    With `blu` (mm) the positions are whole BLU, and `theory`, of the same arguments, yields them before that. `word` is
    the reference word method, whose steps can be reported.
    """

    name: str
    function: Callable[[Segment, float, Mapping[str, Any]], Any]
    source: Source
    params: Mapping[str, Any] = field(default_factory=dict)
    blu: float | None = None
    theory: Callable[[Segment, float, Mapping[str, Any]], Any] | None = None
    word: Method | None = None

    def __repr__(self) -> str:
        said = listed(self.params)
        return f"<Interpolator {self.name}{': ' if said else ''}{said}>"

    def interpolate(self, segment: Segment, T: float) -> Rows:
        """Its rows (mm, mm/s, mm/s²) every `T` s."""
        yield from self._called(self.function, segment, T)

    def theoretical(self, segment: Segment, T: float) -> Rows:
        """Its rows before positions are made whole BLU."""
        yield from self._called(self.theory or self.function, segment, T)

    def rows(self, segment: Segment, T: float) -> np.ndarray:
        """Its theoretical rows as an array of shape (rows, 3, axes); errors as of `each`."""
        rows = list(self.each(segment, T))
        return np.array(rows) if rows else np.empty((0, 3, len(segment.start)))

    def each(self, segment: Segment, T: float) -> Iterator[np.ndarray]:
        """Its theoretical rows one by one, as they are made: arrays of shape (3, axes).

        Raises InputError for a segment or a period that can't be, ContractError where a user's function breaks its
        interface; `rds check` names every fault.
        """
        segment = checked(segment, T)
        expected = length(segment) / segment.feed_rate / T
        if not expected <= _MOST:
            said = f"a segment of {length(segment):g} mm at {segment.feed_rate:g} mm/s makes {expected:.3g} samples"
            raise InputError(f"{said} of {T:g} s, more than {_MOST}; give a longer sample period or a shorter path")
        most = _ROWS_PER_ROW * int(expected) + _SPARE_ROWS
        whole, way, here = length(segment), 0.0, list(segment.start)
        with_errors = self._errors(segment)
        for k, row in enumerate(with_errors(self.theoretical(segment, T))):
            values = self._row(row, len(segment.start), k)
            there = values[0].tolist()
            way += dist(here, there)
            here = there
            yield values
            if k >= most:
                raise self._broken(f"has yielded {most} rows of a segment of {whole:g} mm, and no end")
        if way < _LEAST_SHARE * whole and whole > _POINT:  # a full circle that is taken for a line is over at once
            kind = "an arc" if isinstance(segment, ArcSegment) else "a line"
            if expected <= 1.0:
                said = f"{kind} of {whole:g} mm takes {expected:.2g} sample periods at {segment.feed_rate:g} mm/s"
                remedy = "lower the feed rate, or shorten the sample period"
                raise InputError(f"{said}, and {self.name} goes {way:g} mm of it; {remedy}")
            raise self._broken(
                f"has gone {way:g} mm of {kind} of {whole:g} mm: go all of it, or raise a ValueError for what it does "
                "not handle"
            )

    def steps(self, segment: Segment, T: float) -> Steps | None:
        """How a reference word method takes an arc; None for other methods and for lines."""
        if self.word is None or not isinstance(segment, ArcSegment):
            return None
        return steps(segment, self.params, self.word, T)

    def _called(self, function: Callable[..., Any], segment: Segment, T: float) -> Rows:
        rows: Any = function(segment, T, dict(self.params))
        if not isinstance(rows, Iterable):
            raise self._broken(f"returned {rows!r:.60}, and no rows: yield each of them, or return them as a list")
        return iter(rows)

    def _errors(self, segment: Segment) -> Callable[[Rows], Rows]:
        return (lambda rows: rows) if self.source.path is None else partial(self._blamed, segment)

    def _blamed(self, segment: Segment, rows: Rows) -> Rows:
        try:
            yield from rows
        except ContractError:
            raise
        except STUDENT_ERRORS as error:
            kind = type(segment).__name__
            raise self._broken(f"failed for {kind}: {student_error(error, self.source)}") from error

    def _row(self, row: Any, axes: int, k: int) -> np.ndarray:
        try:
            if is_masked(row):
                raise TypeError
            values = np.array(row, dtype=float)  # by far the most frequent form
            if values.shape != (3, axes):
                values = np.array([np.atleast_1d(np.asarray(part, dtype=float)) for part in row])
        except (TypeError, ValueError):
            values = np.empty(0)
        if values.shape != (3, axes) or not np.isfinite(values).all():
            wanted = f"(position, velocity, acceleration), {axes} finite number{'s' if axes > 1 else ''} each"
            raise self._broken(f"yielded {row!r:.100} as row {k}, not {wanted}")
        return values

    def _broken(self, said: str) -> ContractError:
        remedy = f"`rds check {self.source.name}` names its faults" if self.source.path else "correct it"
        return ContractError(f"interpolate() {said}; {remedy}", self.source.path or self.name)


def find_interpolator(name: str, options: Mapping[str, Any] | None = None) -> Interpolator:
    """By library name, or the file at this path. InputError for what is neither, or an option that won't do."""
    if name not in LIBRARY.modules and (name.endswith(".py") or Path(name).is_file()):
        return from_student(load_student(name), options)
    return from_library(name, options or {})


def as_interpolator(given: Any) -> Interpolator:
    """What a person may give for one: itself, a name of the library, the path of a .py file, or a function."""
    if isinstance(given, Interpolator):
        return given
    if isinstance(given, str | Path):
        return find_interpolator(str(given))
    if callable(given):
        return from_student(from_function(given, role="interpolate"))
    raise InputError(f"{shortened(given)} is no interpolator; give a name of the library, a .py file, or a function")


def common_blu(used: Iterable[Interpolator]) -> float | None:
    """The basic length unit (mm) in which positions along one path are whole; None without. InputError for two."""
    sizes = sorted({each.blu for each in used if each.blu is not None})
    if len(sizes) > 1:
        raise InputError(f"lines and arcs have a BLU each, {sizes[0]:g} and {sizes[1]:g} mm; give both the same blu")
    return sizes[0] if sizes else None


def library_interpolator(name: str = DEFAULT, **options: Any) -> Interpolator:
    """The library's interpolator called `name`; InputError for an unknown name or option, or a value that won't do."""
    return from_library(name, options)


def from_library(name: str, options: Mapping[str, Any]) -> Interpolator:
    """The library's interpolator called `name`, with its options checked."""
    module = LIBRARY.module(name)
    params = getattr(module, "DEFAULTS", {}) | read_options(options, module.OPTIONS, f"interpolator {name!r}")
    if "steps" in params:
        check_steps(params["steps"], f"interpolator {name!r}")
    return Interpolator(
        name,
        module.interpolate,
        Source(name),
        params,
        blu=params["blu"] if hasattr(module, "theory") else None,
        theory=getattr(module, "theory", None),
        word=getattr(module, "METHOD", None),
    )


def from_student(student: StudentFile, options: Mapping[str, Any] | None = None) -> Interpolator:
    """A user's interpolator; ContractError if there is none."""
    function = student.functions.get("interpolate")
    if function is None:
        raise ContractError(f"no interpolator: it defines no {form('interpolate')}", student.source.name)
    return Interpolator(student.source.name, function, student.source, student.parameters(options))
