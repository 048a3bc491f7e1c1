"""Model files: what a fit found of an axis, as a TOML file that every mode, design and validation takes.

A file says the structure and its options, each parameter with unit, standard error and 95 % interval, the covariance,
and on what data it rests: names, SHA-256 and stretches of the logs, and the voltages and velocities that occurred in
them, beyond which the model is a guess. A student's own structure is named by its file, from the model file's folder,
with that file's SHA-256: parameters fitted to one text mean nothing in another.

Written by hand, a file needs `structure` and the `value` and `unit` of each parameter, and no more.
"""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.atomic import keep_another, write_whole
from rds.core.errors import InputError
from rds.core.installed import version
from rds.core.quantities import AnyValue, Declaration, Items, Quantity, Table, Tables, Text
from rds.core.toml_table import TomlTable
from rds.core.toml_text import toml_text
from rds.identification.fit.estimate import UNUSABLE, Errors, Estimate, Parameter, in_a_line, said_of_guesses
from rds.identification.structures.signals import VOLTS
from rds.identification.structures.structures import LIBRARY

FORMAT = 1
MARK = "A model of an axis and how far to trust it"  # how each model file begins
_SPREAD = ("std_error", "low", "high")
_ERRORS = ("fit_percent", "rmse", "maximum")
_LOG_TEXTS = ("name", "source", "sha256", "fingerprint", "trace")
_LOG_RANGES = ("command", "velocity", "position")  # lowest and highest that occurred
_HEADER = (
    f"{MARK}, estimated from logged data.\n"
    'An experiment takes it with `[model]` and `file = "..."` (the name of this file).'
)


@dataclass(frozen=True)
class ModelFile:
    """A model file that was read. `covariance` is in the order of `parameters`, NaN where the file gives none."""

    structure: str  # axis, axis-mass, spindle, or the absolute path of a student's file
    options: tuple[str, ...]
    parameters: Mapping[str, Parameter]
    covariance: np.ndarray
    method: str = ""
    logs: tuple[Mapping[str, Any], ...] = ()  # as in the file: name, source, sha256, first, end, command, ...
    warnings: tuple[str, ...] = ()
    unidentifiable: tuple[str, ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    structure_sha256: str = ""  # of the student's file
    path: str = ""
    sha256: str = ""  # of the model file itself
    text: str = ""
    output_unit: str = "mm"  # of what it answers
    command_unit: str = "V"

    def __repr__(self) -> str:
        return f"<ModelFile {Path(self.path).name} of {self.structure}: {in_a_line(self.parameters)}>"

    @property
    def is_student(self) -> bool:
        """Whether the structure is a student's file."""
        return self.structure.endswith(".py")

    def values(self) -> dict[str, float]:
        """The estimates by name."""
        return {name: parameter.value for name, parameter in self.parameters.items()}

    def units(self) -> dict[str, str]:
        """The parameters' units by name."""
        return {name: parameter.unit for name, parameter in self.parameters.items()}

    def unusable(self) -> list[str]:
        """The fit's warnings that leave nothing to believe in."""
        return [sentence for sentence in self.warnings if UNUSABLE in sentence]

    def doubts(self) -> list[str]:
        """What whoever uses the parameters must hear: that they are not to be used, and which are guesses."""
        return [*self.unusable(), *said_of_guesses(self.parameters)]

    def fitted_on(self) -> tuple[str, ...]:
        """SHA-256 of the files that it was fitted to: data it must not be validated on alone."""
        return tuple(dict.fromkeys(str(log["sha256"]) for log in self.logs if log.get("sha256")))


def check_place(path: Path) -> None:
    """InputError for a path at which no model file can stand, or another file does."""
    if path.suffix != ".toml":
        raise InputError("a model file is TOML; give it a name that ends in .toml", str(path))
    keep_another(path, MARK, "model file")


def write_model(path: str | Path, estimate: Estimate) -> Path:
    """Write what a fit found as a model file at `path`, whole or not at all.

    Entries of `estimate.logs` may hold, beside name, source, sha256, first and end, the lowest and highest `command`
    (V) and `velocity` (mm/s) that occurred. Raises InputError for a path that cannot be written or where another file
    is, and for a student's structure whose file is gone.
    """
    path = Path(path)
    check_place(path)
    return write_whole(path, model_text(estimate, path).encode())


def model_text(estimate: Estimate, path: Path) -> str:
    """The text of the model file that stands, or will stand, at `path`."""
    structure, sha256 = estimate.structure, None
    if structure.endswith(".py"):
        sha256 = file_sha256(Path(structure))
        structure = Path(os.path.relpath(Path(structure).resolve(), path.resolve().parent)).as_posix()
    table: dict[str, Any] = {"format": FORMAT, "structure": structure}
    if sha256:
        table["structure_sha256"] = sha256
    if (estimate.output_unit, estimate.command_unit) != _usual_units(estimate.structure):
        table |= {"output_unit": estimate.output_unit, "command_unit": estimate.command_unit}
    table |= {
        "options": list(estimate.options),
        "method": estimate.method,
        "warnings": list(estimate.warnings),
        "unidentifiable": list(estimate.unidentifiable),
        "parameters": {
            name: {"value": p.value, "unit": p.unit, "std_error": p.std_error, "low": p.low, "high": p.high}
            for name, p in estimate.parameters.items()
        },
        "covariance": {"order": list(estimate.parameters), "rows": np.asarray(estimate.covariance, float).tolist()},
        "versions": {"rds": version(), "numpy": np.__version__, "python": platform.python_version()},
        "logs": [_log_table(log, estimate) for log in estimate.logs],
    }
    return toml_text(table, _HEADER)


def _usual_units(name: str) -> tuple[str, str]:
    """What a file that states no units means by the structure."""
    return ("mm" if name.endswith(".py") else LIBRARY.module(name).OUTPUTS[0], VOLTS)


def _log_table(log: Mapping[str, Any], estimate: Estimate) -> dict[str, Any]:
    name = str(log.get("name", ""))
    table: dict[str, Any] = {key: str(log[key]) for key in _LOG_TEXTS if log.get(key)}
    table |= {key: int(log[key]) for key in ("first", "end") if key in log}
    table |= {key: [float(value) for value in log[key]] for key in _LOG_RANGES if log.get(key) is not None}
    if "resolution" in log:
        table["resolution"] = float(log["resolution"])
    if name in estimate.initial_state:
        table["initial_state"] = [float(value) for value in estimate.initial_state[name]]
    if name in estimate.free_run:
        table["free_run"] = _errors_table(estimate.free_run[name])
    if name in estimate.ahead:
        table["ahead"] = {str(steps): _errors_table(errors) for steps, errors in estimate.ahead[name].items()}
    return table


def _errors_table(errors: Errors) -> dict[str, Any]:
    return {key: float(getattr(errors, key)) for key in _ERRORS} | {"unit": errors.unit}


_MAY_BE_UNKNOWN = "a number (nan where it is not known)"
_FIGURES: Mapping[str, Declaration] = {
    **{key: AnyValue(_MAY_BE_UNKNOWN) for key in _ERRORS},
    "unit": Text("unit of rmse and maximum"),
}
_PARAMETER = Table(
    "a parameter",
    {
        "value": Quantity("value of the parameter"),
        "unit": Text('unit of the parameter; "" for a pure number'),
        **{key: AnyValue(_MAY_BE_UNKNOWN) for key in _SPREAD},
    },
    needed=("value", "unit"),
)
_SAMPLE = Quantity("number of a sample", "", 0, 10**12, whole=True)
_LOG = Table(
    "a log that it was fitted to",
    {
        **{key: Text(f"{key} of the log") for key in _LOG_TEXTS},
        "first": _SAMPLE,
        "end": _SAMPLE,
        **{key: AnyValue(f"{key} of the log, numbers") for key in (*_LOG_RANGES, "initial_state")},
        "resolution": Quantity("step of the encoder, in the unit of the position", "", above=0.0),
        "free_run": Table("errors of a free run", _FIGURES),
        "ahead": Table("errors so many samples ahead", others=Table("errors", _FIGURES)),
    },
)
MODEL_FILE = Table(
    "A model file, as `rds fit` writes it.",
    {
        "format": Quantity(
            "format of model files that this version reads", "", FORMAT, FORMAT, default=FORMAT, whole=True
        ),
        "structure": Text("structure of the model, or a student's .py file"),
        "structure_sha256": Text("SHA-256 of the student's file", ""),
        "options": Items("options of the structure", Text("name"), "a list of texts"),
        "output_unit": Text("unit of its position, or of its speed", ""),
        "command_unit": Text("unit of what commands it", "V"),
        "method": Text("how it was fitted", ""),
        "warnings": Items("what was noticed", Text("sentence"), "a list of texts"),
        "unidentifiable": Items("parameters that the data do not determine", Text("name"), "a list of texts"),
        "parameters": Table("parameters by name", others=_PARAMETER),
        "covariance": Table(
            "covariance of the parameters",
            {"order": Items("names", Text("name"), "a list of texts"), "rows": AnyValue("rows of the matrix")},
        ),
        "logs": Tables("logs that it was fitted to", _LOG),
        "versions": Table("versions of programs", others=Text("version")),
    },
    needed=("structure", "parameters"),
)


def read_model(path: str | Path) -> ModelFile:
    """The model file at `path`; InputError with file, line, key, value and remedy for whatever will not do.

    No key is ignored. That the parameters are those of the structure is checked when the model is used.
    """
    words = TomlTable.open(path, MODEL_FILE)
    if "parameters" not in words:
        makes = "`rds fit LOG --structure axis -o MODEL.toml` makes one"
        if "reference" in words or "controller" in words:
            makes = f"it looks like an experiment, which `rds run` takes; {makes}"
        raise InputError(f"it is no model file: there is no [parameters]; {makes}", words.place())
    words.read("format")
    structure = words.read("structure")
    if not structure:
        raise InputError('structure is missing; as in `structure = "axis"`', words.place())
    sha256 = words.read("structure_sha256")
    if sha256 and not structure.endswith(".py"):
        raise words.fault("structure_sha256", "is for a student's structure, a .py file; remove it")
    if structure.endswith(".py"):
        structure = str((Path(path).resolve().parent / structure).resolve())
    try:
        usual = _usual_units(structure)[0]
    except InputError as error:  # there is no such structure
        raise InputError(str(error), words.place()) from error
    parameters = _read_parameters(words)
    logs = tuple(_read_log(log) for log in words.tables("logs"))
    versions = words.inner("versions")
    read = ModelFile(
        structure=structure,
        options=_texts(words, "options"),
        parameters=parameters,
        covariance=_read_covariance(words, tuple(parameters)),
        method=words.read("method"),
        logs=logs,
        warnings=_texts(words, "warnings"),
        unidentifiable=_texts(words, "unidentifiable"),
        versions={name: versions.read(name) for name in versions.table} if versions else {},
        structure_sha256=sha256,
        path=str(path),
        sha256=file_sha256(Path(path)),
        text=words.source,
        output_unit=words.read("output_unit") or usual,
        command_unit=words.read("command_unit"),
    )
    words.done()
    return read


def file_sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal; InputError if it cannot be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; check the path", str(path)) from error


def _read_parameters(words: TomlTable) -> dict[str, Parameter]:
    tables = words.inner("parameters")
    assert tables is not None  # read_model has looked
    if not tables.table:
        raise InputError("[parameters] is empty; a model has at least one parameter", tables.place())
    read = {}
    for name in tables.table:
        table = tables.inner(name)
        assert table is not None
        value = table.read("value")
        unit = table.read("unit")
        if unit is None:
            raise InputError(f'unit of {name} is missing; as in `unit = "s"` ("" for a pure number)', table.place())
        spread = {key: _real(table, key) for key in _SPREAD}
        if spread["std_error"] < 0.0:
            raise table.fault("std_error", "must not be negative")
        if not (spread["low"] <= value <= spread["high"] or spread["low"] != spread["low"] or "high" not in table):
            raise table.fault("low", f"to high = {spread['high']!r} must be an interval around value = {value!r}")
        table.done()
        read[name] = Parameter(float(value), unit=unit, **spread)
    return read


def _real(table: TomlTable, key: str) -> float:
    """A number that may be infinite or not known (nan): what the data do not tell."""
    value = table.any(key, nan)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise table.fault(key, "must be a number (nan where it is not known)")
    return float(value)


def _read_covariance(words: TomlTable, names: tuple[str, ...]) -> np.ndarray:
    table = words.inner("covariance")
    if table is None:
        return np.full((len(names), len(names)), nan)
    order = _texts(table, "order")
    if order != names:
        raise table.fault("order", f"must be that of [parameters]: {', '.join(names)}")
    rows = table.any("rows")
    try:
        matrix = np.array(rows, dtype=float)
    except (TypeError, ValueError) as error:
        raise table.fault("rows", "must be rows of numbers") from error
    if matrix.shape != (len(names), len(names)):
        raise table.fault("rows", f"must be {len(names)} rows of {len(names)} numbers, one for each parameter")
    known = matrix[np.ix_(np.isfinite(np.diag(matrix)), np.isfinite(np.diag(matrix)))]
    if not np.allclose(known, known.T, rtol=1e-6, atol=0.0, equal_nan=True) or (np.diag(known) < 0.0).any():
        raise InputError(
            "rows must be those of a symmetric matrix, with no negative number on its diagonal", table.place("rows")
        )
    table.done()
    return matrix


def _read_log(table: TomlTable) -> dict[str, Any]:
    log: dict[str, Any] = {key: value for key in _LOG_TEXTS if (value := table.read(key)) is not None}
    for key in ("first", "end"):
        if (sample := table.read(key)) is not None:
            log[key] = sample
    if (step := table.read("resolution")) is not None:
        log["resolution"] = step
    for key, count in (*((key, 2) for key in _LOG_RANGES), ("initial_state", None)):
        if key in table:
            log[key] = _numbers(table, key, count)
    if (errors := table.inner("free_run")) is not None:
        log["free_run"] = _read_errors(errors)
    if (ahead := table.inner("ahead")) is not None:
        log["ahead"] = {}
        for steps in ahead.table:
            if not (steps.isascii() and steps.isdigit()):
                raise ahead.fault(steps, "must stand under a number of samples")
            inner = ahead.inner(steps)
            assert inner is not None
            log["ahead"][int(steps)] = _read_errors(inner)
    table.done()
    return log


def _read_errors(table: TomlTable) -> Errors:
    fit_percent, rmse, maximum = (_real(table, key) for key in _ERRORS)
    errors = Errors(fit_percent, rmse, maximum, table.read("unit", ""))
    table.done()
    return errors


def _texts(words: TomlTable, key: str) -> tuple[str, ...]:
    values = words.any(key, [])
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise words.fault(key, "must be a list of texts")
    return tuple(values)


def _numbers(words: TomlTable, key: str, count: int | None) -> tuple[float, ...]:
    values = words.any(key)
    is_list = isinstance(values, list) and (count is None or len(values) == count)
    if not is_list or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        raise words.fault(key, f"must be a list of {'numbers' if count is None else f'{count} numbers'}")
    return tuple(float(value) for value in values)
