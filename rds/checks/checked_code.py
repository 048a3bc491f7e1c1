"""What a check is given: a file, a function, a module or notebook namespace, a controller or a model."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

from rds.core.errors import ContractError
from rds.core.load import StudentFile, from_function, from_namespace, load_student
from rds.core.signature import form
from rds.core.types import Controller, Model


@dataclass(frozen=True)
class CheckedCode:
    """The student's functions, and where they come from a file, how to load a second copy that remembers nothing."""

    student: StudentFile
    fresh: Callable[[], StudentFile] | None = None

    @property
    def name(self) -> str:
        """The file's or the function's name."""
        return self.student.source.name

    def function(self, role: str) -> Callable[..., Any]:
        """The function in `role`; ContractError if the student gave none."""
        if role not in self.student.functions:
            raise ContractError(f"it defines no {form(role)}", self.student.source.path or self.name)
        return self.student.functions[role]


def checked_code(
    thing: Any, role: str, initial_state: Any = None, params: Mapping[str, Any] | None = None
) -> CheckedCode:
    """`thing` as code to check; a bare function plays `role`. `initial_state` and `params` go before its own.

    Raises what `rds.core.load` raises for what cannot be loaded; arguments and params are left to the check.
    """
    student = _with(_student(thing, role), initial_state, params)
    path = student.source.path
    if path is None or isinstance(thing, Model) or not _is_unchanged(path, student.source.sha256):
        return CheckedCode(student)  # a Model's functions are not those of its file
    return CheckedCode(student, lambda: _with(load_student(path, validate=False), initial_state, params))


def _is_unchanged(path: str, sha256: str | None) -> bool:
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest() == sha256
    except OSError:  # it is gone
        return False


def _with(student: StudentFile, initial_state: Any, params: Mapping[str, Any] | None) -> StudentFile:
    if initial_state is not None:
        student = replace(student, initial_state=initial_state)
    if params is not None:
        own = student.params if isinstance(student.params, Mapping) else {}
        student = replace(student, params={**own, **params})
    return student


def _student(thing: Any, role: str) -> StudentFile:
    if isinstance(thing, CheckedCode):
        return thing.student
    if isinstance(thing, StudentFile):
        return thing
    if isinstance(thing, Controller):
        told = {} if thing.observe is not None else thing.signals  # observed signals are no part of its answer
        return StudentFile(thing.source, {"control": thing.control}, thing.params, thing.initial_state, told)
    if isinstance(thing, Model):
        return StudentFile(thing.source, _model_functions(thing), thing.params, thing.initial_state)
    if isinstance(thing, str | Path):
        return load_student(thing, validate=False)
    if isinstance(thing, Mapping | ModuleType):
        return from_namespace(thing, validate=False)
    return from_function(thing, role=role, validate=False)


def _model_functions(model: Model) -> dict[str, Callable[..., Any]]:
    if model.output is None:
        return {"advance": model.advance}
    return {"advance": model.advance, "output": lambda t, x, u, params: model.seen(x, params, t)}
