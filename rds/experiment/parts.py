"""Models, controllers and signals, from whatever way a user names them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rds.controllers import library_controller
from rds.core.adapt import as_controller, as_model, is_control_system
from rds.core.errors import InputError
from rds.core.load import StudentFile, from_function, from_namespace, load_student
from rds.core.types import Controller, Model
from rds.experiment.words import Words
from rds.machines import Axis
from rds.models import library_model
from rds.models.student import student_model
from rds.signals import Signal, make_signal, user


@dataclass(frozen=True)
class Setting:
    """What parts are made for: the axis, its sample period in s, its converter's limit in V, the user's folder."""

    axis: Axis
    T: float
    limit: float
    folder: Path

    def path(self, name: str) -> Path:
        """A file that the user named, from the folder of the experiment."""
        return self.folder / name


def make_model(words: Words, setting: Setting) -> Model:
    """The axis's model; the machine's own where the user names none."""
    given = words.any("model")
    default = dict(setting.axis.model)
    if given is None:
        return library_model(default.pop("name"), **default)
    if isinstance(given, Model):
        return given
    if is_control_system(given):
        return as_model(given, setting.T)
    if isinstance(given, str):
        given = {"file": given} if given.endswith(".py") else {"name": given}
    student = _student(given, words, setting)
    if student is not None:
        table, found = student
        substeps = table.whole("substeps", 10, "steps of RK4 in each sample", 1, 10_000)
        params = _params(table)
        table.done()
        with _named(table):
            return student_model(found, params=params, substeps=substeps or 10)
    table = _table(given, words, "model")
    name = str(table.text("name"))
    options = {key: table.any(key) for key in table.table if key != "name"}
    same = {} if name != default.pop("name", None) else default
    with _named(table):
        return library_model(name, **(same | options))


def make_controller(words: Words, setting: Setting, model: Model) -> Controller:
    """The axis's controller, designed for its model where it is a library's."""
    given = words.any("controller")
    if given is None:
        raise InputError(
            "controller is missing; add `[controller]` with `name` or `file`, or a `[signal]` to drive without one",
            words.place(),
        )
    if isinstance(given, Controller):
        return given
    if is_control_system(given):
        return as_controller(given, setting.T)
    if isinstance(given, str):
        given = {"file": given} if given.endswith(".py") else {"name": given}
    student = _student(given, words, setting)
    if student is not None:
        table, found = student
        is_coupled, params = table.flag("coupled", False), _params(table)
        table.done()
        with _named(table):
            return found.controller(coupled=is_coupled, params=params)
    table = _table(given, words, "controller")
    name = str(table.text("name"))
    options = {key: table.any(key) for key in table.table if key != "name"}
    design = model.params if {"tau", "K"} <= set(model.params) else setting.axis.model
    with _named(table):
        return library_controller(name, design, setting.T, setting.limit, unit=setting.axis.unit, **options)


def make_drive(words: Words, key: str, setting: Setting, unit: str) -> Signal:
    """The reference or the voltage signal of an axis, in `unit`."""
    given = words.any(key)
    if isinstance(given, Signal):
        return given
    if callable(given):
        return user(function=given)
    table = _table(given, words, key)
    kind = table.text("kind")
    options = {name: table.any(name) for name in table.table if name != "kind"}
    if kind is None:
        raise InputError(f'kind is missing; as in `kind = "sinusoid"` (amplitudes in {unit})', table.place())
    if isinstance(options.get("file"), str):
        options["file"] = str(setting.path(options["file"]))
    with _named(table):
        return make_signal(kind, **options)


def _student(given: Any, words: Words, setting: Setting) -> tuple[Words, StudentFile] | None:
    """The student's functions, if that is what was given: a file, a function, or the variables of a notebook."""
    if isinstance(given, StudentFile):
        return Words({}), given
    if callable(given):
        return Words({}), from_function(given)
    if not isinstance(given, dict):
        return None
    if any(callable(given.get(name)) for name in ("control", "derivatives", "advance")):
        return Words({}), from_namespace(given)
    table = _table(given, words, "")
    if "file" not in table:
        return None
    if "name" in table:
        raise InputError("name and file both say what to take; give one of them", table.place("name"))
    file = table.text("file")
    return table, load_student(setting.path(str(file)))


def _table(given: Any, words: Words, key: str) -> Words:
    if not isinstance(given, dict):
        raise words.fault(key, f"must be a table, as in `[{key}]`")
    for name in ("model", "controller", "reference", "signal"):
        if words.table.get(name) is given:
            inner = words.inner(name)
            assert inner is not None
            return inner
    return Words(given, name=key)


def _params(table: Words) -> dict[str, Any] | None:
    inner = table.inner("params")
    return dict(inner.table) if inner else None


class _named:
    """Errors inside tell the place of the table that asked for it, unless they know a better one."""

    def __init__(self, table: Words):
        self._table = table

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: Any) -> None:
        if isinstance(error, InputError) and error.where is None and (self._table.path or self._table.name):
            raise type(error)(str(error), self._table.place()) from error
