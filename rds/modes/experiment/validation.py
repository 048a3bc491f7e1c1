"""How a run that drives machine and model with the same voltage ends: with what that proves of the model."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.core.types import Model
from rds.modes.loop.plan import Plan
from rds.results import Result

if TYPE_CHECKING:
    from rds.identification.validate.validate import Validation


def validated(plan: Plan, result: Result) -> Result:
    """`result` with the validation of each axis's model: whole in `validation`, its numbers in `meta["validation"]`.

    An axis whose run is too short, or whose model fails on its log, gets a note instead.
    """
    from rds.identification.logs.result_log import logs_of_result
    from rds.identification.validate.validate import validate

    found: dict[str, Validation] = {}
    try:
        logs = logs_of_result(result, "this run", "", "")
    except InputError as error:  # killed in its first samples: what is said of its ending must be read
        result.meta["notes"].append(f"no model is validated: {error}")
        return result
    for axis, log in zip(plan.axes, logs, strict=True):
        try:
            found[axis.axis.name] = validate(_candidate(axis.model, axis.axis.unit), log)
        except InputError as error:
            result.meta["notes"].append(f"the model of {axis.axis.name} is not validated: {error}")
    numbers: dict[str, Any] = {name: validation.to_json() for name, validation in found.items()}
    if numbers:
        result.meta["validation"] = numbers
        result.validation = found
    return result


def _candidate(model: Model, unit: str) -> Any:
    """The model with the record of its fit, where it came from a model file."""
    from rds.identification.validate.candidate import as_candidate, of_model

    if model.fitted is not None and model.fitted.path is not None:
        return as_candidate(model.fitted.path)
    return of_model(model, unit=unit)
