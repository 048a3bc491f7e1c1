"""A student's file, function or notebook namespace as a model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import ContractError
from rds.core.interrupt import Endless
from rds.core.load import StudentFile
from rds.core.signature import form
from rds.core.types import Model
from rds.models.ode import SUBSTEPS, advance_model, ode_model

DEFAULT_STATE = (0.0, 0.0)  # position and velocity


def student_model(student: StudentFile, params: Mapping[str, Any] | None = None, substeps: int = SUBSTEPS) -> Model:
    """The model that `student` defines, with `params` over its own; `advance` goes before `derivatives`.

    `substeps` are the steps of RK4 in each sample. Raises ContractError if it defines no model, or a model that
    does not work on the default state [0.0, 0.0] and has no `initial_state`; InputError for an unknown parameter.
    """
    where = student.source.path or student.source.name
    functions = student.functions
    if "advance" not in functions and "derivatives" not in functions:
        raise ContractError(f"no model: it defines neither {form('derivatives')} nor {form('advance')}", where)
    merged = student.parameters(params)
    state = DEFAULT_STATE if student.initial_state is None else student.initial_state
    if student.initial_state is None:
        _check_default_state(functions, merged, student, where)
    output = functions.get("output")
    if "advance" in functions:
        return advance_model(functions["advance"], state, merged, output, student.source)
    return ode_model(functions["derivatives"], state, merged, output, substeps, student.source)


def _check_default_state(
    functions: Mapping[str, Callable[..., Any]], params: dict[str, Any], student: StudentFile, where: str
) -> None:
    """One trial call, because a wrong number of states otherwise comes out as an index error inside a run."""
    x, u = np.array(DEFAULT_STATE), np.zeros(1)
    advance = functions.get("advance")
    name = "advance" if advance else "derivatives"
    missing = f"there is no initial_state, and {name}() does not work on the default, {list(DEFAULT_STATE)}"
    try:
        answer = advance(x, u, 1e-3, params) if advance else functions["derivatives"](0.0, x, u, params)
        size = len(answer)
    except Endless as error:
        raise ContractError(student_error(error, student.source), where) from error
    except (IndexError, TypeError, ValueError) as error:
        said = student_error(error, student.source)
        raise ContractError(f"{missing}: {said}; define initial_state with one number for each state", where) from error
    except STUDENT_ERRORS:
        return  # not for want of a state: whoever runs it reports it
    if size != len(DEFAULT_STATE):
        raise ContractError(f"{missing}: it returns {size} values; define initial_state = {[0.0] * size}", where)
