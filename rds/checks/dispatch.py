"""One door to the checks, for whatever a user hands in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from rds.checks.controller import check_controller
from rds.checks.file import check_file
from rds.checks.interpolator import check_interpolator
from rds.checks.model import check_model
from rds.checks.report import CheckReport, FileReport
from rds.core.adapt import is_control_system
from rds.core.errors import InputError
from rds.core.load import StudentFile, from_function, from_namespace
from rds.core.types import Controller, Model


def check(thing: Any, sample_period: float = 0.001) -> FileReport:
    """Check a file (by its path), a function, a module or notebook namespace, a `Controller` or a `Model`.

    A file runs in a process of its own, everything else in this one. Raises InputError for what cannot be loaded or
    fills no interface.
    """
    if isinstance(thing, str | Path):
        return check_file(thing, sample_period)
    if isinstance(thing, Controller):
        return FileReport(thing.source.name, (check_controller(thing, sample_period),))
    if isinstance(thing, Model):
        return FileReport(thing.source.name, (check_model(thing, sample_period),))
    if is_control_system(thing):
        said = f"a system of python-control, {type(thing).__name__}, may be a controller or a model"
        raise InputError(f"{said}; use check_controller or check_model")
    student = _student(thing)
    checks: dict[str, Callable[..., CheckReport]] = {
        "controller": check_controller,
        "model": check_model,
        "interpolator": check_interpolator,
    }
    reports = tuple(checks[interface](student, sample_period) for interface in student.interfaces)
    return FileReport(student.source.name, reports)


def _student(thing: Any) -> StudentFile:
    if isinstance(thing, StudentFile):
        return thing
    if isinstance(thing, Mapping | ModuleType):
        return from_namespace(thing, validate=False)
    return from_function(thing, validate=False)
