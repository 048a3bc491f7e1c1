"""A student's own file on the student's own computer, without a sandbox: it can do whatever its author can.

For `rds grade self --trust-my-file` only. Its answers are those of the sandbox, by the same laws; nothing is limited,
and work is not counted. Nobody else's file may be run so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any

from rds.checks.rows import iterate, row_of
from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import InputError
from rds.core.load import StudentFile, load_student
from rds.core.types import Reference, Segment
from rds.grading.cases.case import Row
from rds.grading.grade import Status
from rds.grading.sandbox.errors import SubmissionError
from rds.grading.sandbox.inside.plain import NotPlain, plain
from rds.grading.sandbox.limits import Limits
from rds.grading.sandbox.submission import read_submission
from rds.grading.sandbox.work_counts import WorkCounts
from rds.machines.converter import as_voltage
from rds.models.student import student_model
from rds.modes.loop.laws import LiveReference, controlled, coupled
from rds.modes.parts import start


class TrustedFiles:
    """Opens files in this process; takes the place of `sandbox.Pool` for one's own."""

    counts_work = False

    @contextmanager
    def open(self, path: str | Path, limits: Limits | None = None, kind: str = "controller") -> Iterator[TrustedFile]:
        """The file, loaded. SubmissionError if it cannot be."""
        read_submission(Path(path))  # refuses what the sandbox would
        yield TrustedFile(Path(path), kind)


class TrustedFile:
    """As `sandbox.LoadedSubmission`, in this process. Each run that is begun loads the file afresh."""

    output = said_loading = ""  # it prints where its author sees it

    def __init__(self, path: Path, kind: str):
        self._path, self._kind = path, kind
        self._calls = 0
        self._law: Any = None
        self._motion: Any = None
        self._k, self._T = 0, 0.0
        if kind != "functions" and kind not in self._load().interfaces:
            raise SubmissionError(Status.FAILED_TO_LOAD, f"{path.name}: it defines no {kind}")

    @property
    def defines(self) -> tuple[str, ...]:
        """The names of what can be called in it."""
        with self._blamed():
            return tuple(name for name, value in _functions(self._path).items() if callable(value))

    @property
    def counts(self) -> WorkCounts:
        """Its calls; events are counted in the sandbox only."""
        return WorkCounts(self._calls, refused="work is counted in the sandbox only")

    def begin_control(self, params: Mapping[str, Any], initial_state: Any, T: float, axes: Sequence[str]) -> None:
        """A fresh run of the controller."""
        several = len(axes) > 1
        self._references = [LiveReference() for _ in axes]
        self._calls, self._k, self._T = 0, 0, T
        with self._blamed():
            controller = self._load().controller(coupled=several, params=params)
            own = dict(controller.params)
            if several:
                limits = [as_voltage] * len(axes)
                self._law = coupled(range(len(axes)), axes, controller, self._references, T, limits, own)
            else:
                self._law = controlled(0, axes[0], controller, self._references[0], T, as_voltage, own)

    def control(self, t: float, r: Reference | Sequence[Any], y: Any) -> Any:
        """One sample; the voltage, V."""
        several = len(self._references) > 1
        for part, values in zip(Reference._fields, r, strict=True):
            for cell, value in zip(self._references, values if several else (values,), strict=True):
                getattr(cell, part).value = float(value)
        voltages: list[float] = []
        with self._blamed():
            self._law(self._k, list(y) if several else [y], [], voltages)
        self._k += 1
        self._calls += 1
        return tuple(voltages) if several else voltages[0]

    def begin_model(self, params: Mapping[str, Any], T: float) -> float:
        """A fresh run of the model; its first output."""
        self._calls = 0
        with self._blamed():
            self._motion = start(student_model(self._load(), params), T)
            return as_voltage(self._motion.read())

    def advance(self, u: float) -> float:
        """One sample of voltage `u`, V; the output after it."""
        self._calls += 1
        with self._blamed():
            self._motion.write(u)
            output = float(self._motion.read())
        if not isfinite(output):
            raise SubmissionError(Status.BROKE_CONTRACT, f"its model gave {output!r}, which is not finite")
        return output

    def rows(self, segment: Segment, T: float, params: Mapping[str, Any], most: int) -> Iterator[Row]:
        """The rows of the interpolator."""
        self._calls = 0
        with self._blamed():
            student = self._load()
            given = iterate(student.functions["interpolate"](segment, T, student.parameters() | dict(params)))
            if isinstance(given, str):
                raise InputError(f"interpolate() returned {given}")
            for row in given:
                values = row_of(row, len(segment.start))
                if isinstance(values, tuple):
                    raise InputError(f"row {self._calls}: {values[1]}")
                self._calls += 1
                if self._calls > most:
                    raise InputError(f"its interpolator has no end, or is far too slow: more than {most} rows")
                position, velocity, acceleration = (tuple(part) for part in values.tolist())
                yield position, velocity, acceleration

    def call(self, name: str, args: Sequence[Any]) -> Any:
        """What one of its functions returns for plain arguments."""
        with self._blamed():
            function = _functions(self._path).get(name)
            if not callable(function):
                raise InputError(f"it defines no function {name}()")
            try:
                return plain(function(*args))
            except NotPlain as fault:
                raise InputError(f"{name}() returned what is not made of numbers, texts and lists: {fault}") from fault
            except STUDENT_ERRORS as error:
                raise InputError(f"{name}() failed: {student_error(error, self._path)}") from error

    def _load(self) -> StudentFile:
        try:
            return load_student(self._path)
        except (InputError, *STUDENT_ERRORS) as error:
            raise SubmissionError(Status.FAILED_TO_LOAD, str(error)) from error

    @contextmanager
    def _blamed(self) -> Iterator[None]:
        try:
            yield
        except (SubmissionError, GeneratorExit):
            raise
        except (InputError, NotPlain) as error:
            raise SubmissionError(Status.BROKE_CONTRACT, str(error)) from error
        except STUDENT_ERRORS as error:
            raise SubmissionError(Status.BROKE_CONTRACT, student_error(error, self._path)) from error


def _functions(path: Path) -> dict[str, Any]:
    from runpy import run_path

    return run_path(str(path))
