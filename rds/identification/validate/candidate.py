"""A model that is to be validated: a structure with values, and what is known of where these came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.types import Model
from rds.identification.fit.estimate import Errors, Estimate, Parameter
from rds.identification.logs.log import Log
from rds.identification.structures.model_structure import structure_of_model
from rds.identification.structures.structure import Structure


@dataclass(frozen=True)
class Candidate:
    """A model with its record. `covariance` is in the order of `parameters`; None where it is not known.

    `fitted_on` holds what the fit said of each of its logs: name, source, sha256, first, end, command and velocity
    (lowest and highest), free_run, fingerprint, so far as known; empty for a model that nobody says was fitted.
    """

    name: str
    structure: Structure
    values: Mapping[str, float]
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    covariance: np.ndarray | None = None
    fitted_on: tuple[Mapping[str, Any], ...] = ()
    source: str = ""
    unusable: tuple[str, ...] = ()  # what the fit warned of that leaves nothing to believe in
    model: Model | None = None  # as it was given, where it was one already

    @property
    def is_rate(self) -> bool:
        """Whether the output is a speed (a spindle) and not a position."""
        return self.structure.is_rate or "position" not in self.structure.state_names or self.structure.states == 1

    @property
    def estimated(self) -> tuple[str, ...]:
        """The parameters that have a standard error: those that a fit adjusted."""
        return tuple(n for n, p in self.parameters.items() if isfinite(p.std_error) and p.std_error > 0.0)

    def fit_predictions(self) -> list[Mapping[int, Errors]]:
        """Errors on each of the fit's own logs by the number of samples predicted ahead, so far as recorded."""
        unit = self.structure.output_unit
        return [
            {k: errors for k, errors in log["ahead"].items() if errors.unit == unit}
            for log in self.fitted_on
            if isinstance(log.get("ahead"), Mapping)
        ]

    def range_of(self, quantity: str) -> tuple[float, float] | None:
        """The lowest and highest `command` (V) or `velocity` (mm/s) of the fit's logs; None where not recorded."""
        found = [log[quantity] for log in self.fitted_on if log.get(quantity) is not None]
        return (min(low for low, _ in found), max(high for _, high in found)) if found else None


def as_candidate(model: Any, name: str = "") -> Candidate:
    """Whatever says what the model is, as a candidate.

    `model` may be a candidate, an `Estimate`, a `ModelFile`, an `rds.Model`, the path of a model file (.toml) or of a
    student's file (.py, with its own `params`). Raises InputError for anything else, or for one that will not do.
    """
    if isinstance(model, Candidate):
        return replace(model, name=name) if name else model
    if isinstance(model, Estimate):
        return _of_estimate(model, name)
    if isinstance(model, Model):
        return of_model(model, name)
    if isinstance(model, str | Path):
        return _of_path(Path(model), name)
    from rds.identification.fit.model_file import ModelFile

    if isinstance(model, ModelFile):
        return _of_file(model, name)
    raise InputError(
        f"{model!r:.60} is no model; give the path of a model file (.toml) or a student's file (.py), an estimate, or "
        "a model"
    )


def of_model(model: Model, name: str = "", unit: str = "mm") -> Candidate:
    """A library's or student's model, whose parameters nobody says were fitted; `unit` is that of its output."""
    made = structure_of_model(model, unit)
    values = {key: float(model.params[key]) for key in made.parameters}
    return Candidate(name or model.source.name, made, values, source=model.source.path or "", model=model)


def _of_estimate(estimate: Estimate, name: str) -> Candidate:
    from rds.identification.structures.structures import structure

    logs = tuple({**log, "ahead": estimate.ahead.get(str(log.get("name", "")), {})} for log in estimate.logs)
    return Candidate(
        name=name or estimate.structure,
        structure=structure(estimate.structure, estimate.options, estimate.output_unit, estimate.command_unit),
        values=estimate.values(),
        parameters=dict(estimate.parameters),
        covariance=estimate.covariance,
        fitted_on=logs,
        unusable=tuple(estimate.unusable()),
    )


def _of_path(path: Path, name: str) -> Candidate:
    if path.suffix == ".py":
        from rds.core.load import load_student
        from rds.models.student import student_model

        return of_model(student_model(load_student(path)), name or path.name)
    if path.suffix != ".toml":
        raise InputError(
            "a model is a model file (.toml, as `rds fit -o` writes it) or a student's file (.py)", str(path)
        )
    from rds.identification.fit.model_file import read_model

    return _of_file(read_model(path), name)


def _of_file(file: Any, name: str) -> Candidate:
    from rds.identification.fit.model_file import file_sha256
    from rds.identification.fit.run_model import checked_structure

    if file.is_student and file.structure_sha256 and file_sha256(Path(file.structure)) != file.structure_sha256:
        raise InputError(
            f"the structure {file.structure} has changed since these parameters were fitted; fit it again", file.path
        )
    values = file.values()
    try:
        made = checked_structure(file)
        for key, value in values.items():
            made.parameters[key].check(value, key, made.name)
    except InputError as error:
        raise error if error.where else InputError(str(error), file.path) from error
    return Candidate(
        name=name or Path(file.path).stem,
        structure=made,
        values=values,
        parameters=dict(file.parameters),
        covariance=file.covariance,
        fitted_on=tuple(file.logs),
        source=file.path,
        unusable=tuple(file.unusable()),
    )


def check_units(candidate: Candidate, log: Log) -> None:
    """InputError where the log's command or position is in another unit than the model's."""
    takes, given = candidate.structure.command_unit, log.units.get("command") or candidate.structure.command_unit
    if given != takes:
        raise InputError(
            f"the command is in {given} and the model {candidate.name} takes {takes}: they cannot be compared. Where "
            f'a drive\'s {given} stands for its {takes}, say so in the map: unit = "{takes}" for the command, with '
            f"scale = ... as so many {takes} per {given}",
            log.source or log.name,
        )
    unit, has = candidate.structure.output_unit, log.units.get("position", "")
    if has and unit and has != unit:
        raise InputError(
            f"the position is in {has} and the model {candidate.name} answers in {unit}; they cannot be compared. "
            "State the unit of the column in the log's map",
            log.source or log.name,
        )
