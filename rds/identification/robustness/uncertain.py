"""An axis of an experiment whose parameters are uncertain: what they may be, and the model for any of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.load import StudentFile, load_student
from rds.core.toml_table import TomlTable
from rds.core.types import Model
from rds.identification.fit.estimate import said_of_guesses
from rds.identification.fit.model_file import ModelFile, read_model
from rds.identification.fit.run_model import checked_structure, library_table, student_structure
from rds.identification.robustness.draws import LEVEL, Spread, check_covariance
from rds.identification.structures.structure import Structure
from rds.models import library_model, model_names
from rds.models.student import student_model
from rds.modes.loop.plan import AxisPlan

_NORMAL = 1.959964  # standard errors to either side hold 95 % of the normal distribution
_LARGEST = 1e300  # a range's ends: their differences stay finite
Ranges = Mapping[str, Mapping[str, tuple[float, float]]]  # per axis and parameter: lowest, highest


@dataclass(frozen=True)
class Uncertain:
    """An axis with its spread; `model(values)` is its model for some values of the parameters."""

    name: str  # of the axis
    spread: Spread
    base: Model
    made: Structure | None = None  # of a model file with a library structure
    student: StudentFile | None = None
    doubts: tuple[str, ...] = ()  # of the fit: why its parameters, or which of them, are not to be used

    def model(self, values: Mapping[str, float]) -> Model:
        """The model with these values, the others as in the experiment. InputError for what is impossible."""
        if self.student is not None:
            return student_model(self.student, {**self.base.params, **values})
        if self.made is not None:
            table = library_table(self.made, values)
            return library_model(table.pop("name"), **table)
        return library_model(self.base.source.name, **{**self.base.params, **values})

    def drawn(self, row: np.ndarray) -> Model:
        """The model of one draw."""
        return self.model(dict(zip(self.spread.names, map(float, row), strict=True)))


def uncertain(axis: AxisPlan, ranges: Mapping[str, tuple[float, float]] | None, level: float = LEVEL) -> Uncertain:
    """What the axis may be: by `ranges` where they are given, else by the covariance of its model file.

    InputError if there is neither, or a range is not one of the model's parameters or not possible.
    """
    model = axis.model
    file = read_model(str(model.fitted.path)) if model.fitted is not None else None
    if file is not None and model.fitted is not None and file.sha256 != model.fitted.sha256:
        raise InputError("it changed while it was read; start again", file.path)
    made = None if file is None or file.is_student else checked_structure(file)
    student = _student(model, file)
    doubts = () if file is None else tuple(file.unusable())
    if ranges:
        if file is not None:  # a guess that the ranges replace is none
            kept = {name: parameter for name, parameter in file.parameters.items() if name not in ranges}
            doubts += tuple(said_of_guesses(kept))
        return Uncertain(axis.axis.name, _by_ranges(axis, file, ranges), model, made, student, doubts)
    if file is None:
        raise InputError(
            f"axis {axis.axis.name}: nothing says how uncertain its model is; give a fitted model ([model] with "
            '`file = "fitted.toml"`, or --model), or ranges (--ranges)'
        )
    low, high = _bounds(made, file)
    values = np.array(list(file.values().values()))
    spread = Spread(tuple(file.parameters), values, file.units(), file.covariance, low, high, level, file.path)
    check_covariance(spread, file)
    return Uncertain(axis.axis.name, replace(spread, covariance=_widened(file)), model, made, student, doubts)


def _widened(file: ModelFile) -> np.ndarray:
    """The covariance of normal draws whose 95 % are the file's intervals: those of few independent samples are wider.

    Student's t has no covariance to draw from where it has few degrees of freedom, and the intervals say it all.
    """
    low, high, error = (
        np.array([getattr(parameter, key) for parameter in file.parameters.values()])
        for key in ("low", "high", "std_error")
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = 0.5 * (high - low) / (_NORMAL * error)
    wider = np.where(wider > 1.0, wider, 1.0)  # 1 where the file states no interval (nan), too
    return file.covariance * np.outer(wider, wider)


def _student(model: Model, file: ModelFile | None) -> StudentFile | None:
    if file is not None:
        return student_structure(file) if file.is_student else None
    path = model.source.path
    return load_student(path) if path is not None else None


def _bounds(made: Structure | None, file: ModelFile) -> tuple[np.ndarray, np.ndarray]:
    if made is None:
        return np.full(len(file.parameters), -np.inf), np.full(len(file.parameters), np.inf)
    low, high = zip(*(made.bounds(name) for name in file.parameters), strict=True)
    # "more than 0" excludes 0 itself, which a draw does not hit
    return np.array(low, float), np.array(high, float)


def _by_ranges(axis: AxisPlan, file: ModelFile | None, ranges: Mapping[str, tuple[float, float]]) -> Spread:
    params = dict(axis.model.params) if file is None else file.values()
    if file is None and axis.model.source.path is None and axis.model.source.name not in model_names():
        raise InputError(f"axis {axis.axis.name}: ranges are for models of the library, files and model files")
    numbers = {key: float(v) for key, v in params.items() if isinstance(v, int | float) and not isinstance(v, bool)}
    for name, ends in ranges.items():
        if name not in numbers:
            raise InputError(f"axis {axis.axis.name} has no parameter {name!r}; it has {', '.join(numbers)}")
        if fault := _fault(ends):
            raise InputError(f"axis {axis.axis.name}: the range {name} = {ends!r:.60} {fault}")
    names = tuple(numbers) if file is not None else tuple(ranges)
    low, high = np.array([ranges.get(name, (numbers[name], numbers[name])) for name in names], float).T
    units = file.units() if file is not None else dict.fromkeys(names, "")
    return Spread(names, np.array([numbers[name] for name in names]), units, None, low, high)


def read_ranges(path: str | Path) -> dict[str, dict[str, tuple[float, float]]]:
    """A file of ranges: a table for each axis, in it a parameter's [lowest, highest]. InputError with its place."""
    words, found = TomlTable.open(path), {}
    for axis in words.table:
        table = words.inner(axis)
        assert table is not None
        found[axis] = {name: _range(table, name) for name in table.table}
        if not found[axis]:
            raise words.fault(axis, "gives no range; give one, as in tau = [0.009, 0.011], or remove the table")
    if not found:
        raise InputError("gives no ranges; it needs a table for an axis, as in [X] and tau = [0.009, 0.011]", str(path))
    return found


def _range(table: TomlTable, name: str) -> tuple[float, float]:
    value: Any = table.any(name)
    if fault := _fault(value):
        raise table.fault(name, fault)
    return float(value[0]), float(value[1])


def _fault(ends: Any) -> str | None:
    """Why these are no ends of a range; None where they are."""
    is_pair = isinstance(ends, list | tuple) and len(ends) == 2
    if not is_pair or not all(isinstance(end, int | float) and not isinstance(end, bool) for end in ends):
        return "must be [lowest, highest]"
    return None if -_LARGEST <= ends[0] <= ends[1] <= _LARGEST else "must be finite, lowest first"
