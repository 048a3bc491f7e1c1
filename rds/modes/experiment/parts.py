"""Models, controllers and signals, from whatever way a user names them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from types import ModuleType
from typing import Any

from rds.controllers import controller_names, library_controller, tracking
from rds.core.adapt import as_controller, as_model, is_control_system
from rds.core.errors import ContractError, InputError
from rds.core.interrupt import limited
from rds.core.load import StudentFile, from_function, from_namespace, load_student
from rds.core.signals import declaration_fault
from rds.core.toml_table import TomlTable
from rds.core.types import Controller, Model
from rds.machines import Axis
from rds.models import library_model, model_names
from rds.models.machine_model import MachineAxisMotion, linear_part
from rds.models.student import student_model
from rds.modes.experiment.experiment_file import PATHS
from rds.modes.loop.commands import Command
from rds.references import Signal, make_signal, user

_FUNCTIONS = ("control", "derivatives", "advance", "output")


@dataclass(frozen=True)
class Setting:
    """What parts are made for: the axis, its sample period in s, the user's folder, and what the axis is commanded by.

    `limit` is the largest command: the converter's range in V, or `top_speed` (unit/s) for a drive's velocity loop.
    `on_bus` says that its command acts one sample later than in a simulation.
    """

    axis: Axis
    T: float
    limit: float
    folder: Path
    command: Command = Command.VOLTAGE
    top_speed: float = inf
    on_bus: bool = False

    def path(self, name: str) -> Path:
        """A file that the user named, from the folder of the experiment."""
        return self.folder / name


def make_model(words: TomlTable, setting: Setting) -> Model:
    """The axis's model; the machine's own where the user names none."""
    given = words.any("model")
    default = dict(setting.axis.model)
    if given is None:
        try:
            return library_model(default.pop("name"), **default)
        except InputError as error:
            raise InputError(str(error), f"[axis.{setting.axis.name}.model] of the machine's file") from error
    if isinstance(given, Model):
        return given
    if is_control_system(given):
        return as_model(given, setting.T)
    table, student = _table_or_student(words, "model", setting)
    if student is not None:
        substeps = table.read("substeps")
        if "substeps" in table and "advance" in student.functions:
            raise table.fault("substeps", "is for derivatives(), and advance() takes a sample in one step; remove it")
        params = _params(table, student)
        table.done()
        with named(table.inner("params") or table), limited():  # it may be called once
            return student_model(student, params, substeps)
    if "file" in table:
        return _fitted_model(table, setting)
    name, options = _name_and_options(table, "model", model_names())
    with named(table):
        return library_model(name, **((default if name == default.pop("name", None) else {}) | options))


def _fitted_model(table: TomlTable, setting: Setting) -> Model:
    """The model of a model file, as `rds fit` writes it."""
    from rds.identification.fit.model_file import read_model
    from rds.identification.fit.run_model import run_model

    path = setting.path(table.read("file"))
    table.done()
    return run_model(read_model(path), unit=setting.axis.unit)


def _refuse_estimate(words: TomlTable, given: Any) -> None:
    """A run says what file its model is from: InputError for what a fit found, or what was read of a file."""
    from rds.identification.fit.estimate import Estimate
    from rds.identification.fit.model_file import ModelFile

    if isinstance(given, ModelFile):
        raise words.fault("model", f"was read already; give the file itself, model={given.path!r}")
    if isinstance(given, Estimate):
        said = "rds.write_model('fitted.toml', estimate) writes it, and model='fitted.toml' runs it"
        raise words.fault("model", f"is what a fit found, and a run wants a file; {said}")


def make_controller(words: TomlTable, setting: Setting, model: Model) -> Controller:
    """The axis's controller, designed for its model where it is a library's."""
    given = words.any("controller")
    if given is None:
        raise InputError(
            f"controller of axis {setting.axis.name} is missing; add `[controller]` with `name` or `file`, or a "
            f"`[signal]` to drive without one{words.slip('controller')}",
            words.place(),
        )
    if isinstance(given, Controller):
        if fault := declaration_fault(given.signals):
            raise ContractError(fault, given.source.path or words.place("controller"))
        return given
    if is_control_system(given):
        return as_controller(given, setting.T)
    table, student = _table_or_student(words, "controller", setting)
    if student is not None:
        is_coupled, params = table.read("coupled"), _params(table, student)
        table.done()
        with named(table.inner("params") or table), limited():  # it is called once
            return student.controller(coupled=is_coupled, params=params)
    name, options = _name_and_options(table, "controller", controller_names())
    if model.motion is MachineAxisMotion:
        design: Mapping[str, Any] = linear_part(model.params)
    else:
        design = model.params if {"tau", "K"} <= set(model.params) else setting.axis.model
    with named(table):
        law = library_controller(name, design, setting.T, setting.limit, unit=setting.axis.unit, **options)
        if setting.on_bus:
            _check_on_bus(law, setting)
        return law


def _check_on_bus(law: Controller, setting: Setting) -> None:
    """InputError for `tracking`, or what is built on it, where a bus's sample of delay makes the loop unstable."""
    is_tracking = "observer_pole" in law.params
    if is_tracking and not tracking.is_stable_on_a_bus(law.params["coefficients"], setting.T):
        raise InputError(
            f"controller {law.source.name!r}: on a bus a command acts one sample of {setting.T:g} s later than in a "
            "simulation, and with these poles or gains the loop is unstable then; choose slower poles or a shorter "
            "sample period"
        )


def make_drive(words: TomlTable, key: str, setting: Setting, unit: str) -> Signal:
    """The reference or the voltage signal of an axis, in `unit`. InputError if sampling is too slow for it."""
    given = words.any(key)
    if not words.path and not isinstance(given, Signal | Mapping | None) and not callable(given):
        makers = 'rds.sinusoid(5.0, 0.2), or rds.user(file="rows.csv") of a file'
        raise words.fault(key, f"must be a signal ({makers}), a function of the time, or a dict")
    table = words.inner(key) if not isinstance(given, Signal) and not callable(given) else None
    with named(table or words.table_of(key, {})):
        signal = _signal(given, table, setting, unit)
        signal.check_sampling(setting.T)
    return signal


def _signal(given: Any, table: TomlTable | None, setting: Setting, unit: str) -> Signal:
    if isinstance(given, Signal):
        return given
    if table is None:
        return user(function=given)
    if "kind" not in table:
        raise InputError(f'kind is missing; as in `kind = "sinusoid"` (amplitudes in {unit})')
    kind = table.read("kind")
    if kind in PATHS.modules:
        where = "a path leads all axes of the run together: give it once, in the general [reference]"
        raise InputError(where, table.place("kind"))
    options = {name: table.any(name) for name in table.table if name != "kind"}
    if isinstance(options.get("file"), str):
        options["file"] = str(setting.path(options["file"]))
    return make_signal(kind, **options)


def _table_or_student(words: TomlTable, key: str, setting: Setting) -> tuple[TomlTable, StudentFile | None]:
    """The table that was given under `key`, and the student's functions if it was a file, or these themselves."""
    given = words.any(key)
    nameless = words.table_of(key, {})
    if isinstance(given, StudentFile):
        return nameless, given
    if isinstance(given, ModuleType) and getattr(given, "__file__", None):
        given = {"file": given.__file__}  # read anew, as each process of a run reads it
    elif isinstance(given, os.PathLike):
        given = {"file": os.fspath(given)}
    elif isinstance(given, str):
        given = {"file" if given.endswith((".py", ".toml")) else "name": given}
    elif isinstance(given, dict) and any(callable(given.get(name)) for name in _FUNCTIONS):
        with named(nameless):
            return _functions(words, key, given), from_namespace(given)
    elif callable(given):
        with named(nameless):
            return nameless, from_function(given, role="control" if key == "controller" else None)
    elif not isinstance(given, dict):
        if key == "model":
            _refuse_estimate(words, given)
        ours = "a function, a python-control system, or a table"
        scipys = type(given).__module__.startswith("scipy.signal")
        also = "; of a system of scipy.signal make one by control.ss or control.tf" if scipys else ""
        raise words.fault(key, f"must be a name, the path of a .py file, {ours}, as in `[{key}]`{also}")
    table = words.table_of(key, given)
    if "file" not in table:
        return table, None
    if "name" in table:
        raise InputError("name and file both say what to take; give one of them", table.place("name"))
    path = setting.path(table.read("file"))
    if not path.is_file():
        kind = f"{path} is a folder" if path.is_dir() else f"there is no such file as {path}"
        raise table.fault("file", f"will not do: {kind}; a name counts from the experiment's folder")
    if path.suffix == ".toml":
        if key != "model":
            raise table.fault("file", f"is no {key}: a .toml file is a model; name the {key}'s .py file")
        return table, None
    return table, load_student(path)


def _functions(words: TomlTable, key: str, given: dict[str, Any]) -> TomlTable:
    """What a table of functions says besides. A notebook's `globals()` holds much else; a table by hand does not."""
    if "__name__" in given:
        return words.table_of(key, {})
    table = words.table_of(key, given)
    for name in ("control",) if key == "controller" else _FUNCTIONS[1:]:
        table.any(name)
    table.any("initial_state")
    if key == "controller":
        table.any("signals")
    return table


def _name_and_options(table: TomlTable, kind: str, known: Sequence[str]) -> tuple[str, dict[str, Any]]:
    """The library part that a table names, and the rest of the table."""
    if "name" not in table:
        raise InputError(f"{kind} needs `name` ({', '.join(known)}) or `file`", table.place())
    if str(table.any("name")).endswith((".py", ".toml")):
        raise table.fault("name", f"is a file, and `name` a part of the library; write `file = {table.any('name')!r}`")
    name = table.read("name")
    return name, {key: table.any(key) for key in table.table if key != "name"}


def _params(table: TomlTable, student: StudentFile) -> dict[str, Any] | None:
    """Values over the file's own; InputError for one that stands beside `params` and not in it."""
    inner = table.inner("params")
    known = () if table.declared is None else table.declared.keys
    if isinstance(student.params, Mapping):
        for key in table.table:
            if key in student.params and key not in known:
                said = f"unknown key '{key}'{f' in [{table.name}]' if table.name else ''}; it is one of the file's own"
                raise InputError(f"{said} params: write `params = {{ {key} = ... }}`", table.place(key))
    return dict(inner.table) if inner else None


class named:
    """Errors inside tell the place of the table that asked for it, unless they know a better one."""

    def __init__(self, table: TomlTable):
        self._table = table

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: Any) -> None:
        if isinstance(error, InputError) and error.where is None and (self._table.path or self._table.name):
            text = str(error)
            key = next((key for key in self._table.table if f"{key} = " in text or repr(key) in text), None)
            raise type(error)(text, self._table.place(key)) from error
