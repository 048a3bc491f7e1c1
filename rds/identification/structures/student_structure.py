"""A user's own model file as a structure: its numeric `params` are what can be estimated.

Beside the interface of a model (`derivatives` or `advance`, maybe `output` and `initial_state`) the file may define

    bounds = {"tau": (0.0, 1.0)}     # lowest and highest value of a parameter; without it any finite number will do
    units = {"tau": "s"}             # shown with the estimate

Derivatives by parameters and initial state are differences of simulations. The search begins at the file's own values.
A run takes ten Runge-Kutta steps in each sample; a fit takes as many as it needs to come as close as the measurement's
noise asks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.blame import STUDENT_ERRORS, student_error
from rds.core.errors import InputError
from rds.core.integrate import SUBSTEPS
from rds.core.load import StudentFile, load_student
from rds.core.quantities import Quantity
from rds.identification.fit.smoothing import motion_of
from rds.identification.fit.solve import first_state
from rds.identification.logs.log import Log, excited_part
from rds.identification.structures.model_structure import structure_of_model
from rds.identification.structures.structure import Structure

_COARSER = (1, 2, 5)  # Runge-Kutta steps in a sample, beside those of a run
_TRIED = 2000  # samples that this is tried on
_CLOSE = 0.1  # of the noise: how far the coarser simulation may be off


def make_from_file(path: str | Path) -> Structure:
    """The structure in a student's file, named by its absolute path.

    InputError for a file that defines no model, has no numeric `params`, or has `bounds` or `units` that make no sense.
    """
    return _structure(load_student(path), path, SUBSTEPS)


def _structure(student: StudentFile, path: str | Path, substeps: int) -> Structure:
    from rds.models.student import student_model

    where = student.source.path or str(path)
    begun = {name: float(value) for name, value in student.params.items() if _is_number(value)}
    if not begun:
        raise InputError(
            "params holds no number to estimate; move the model's constants there, as in "
            'params = {"tau": 0.01, "K": 1.8}',
            where,
        )
    bounds = _bounds(student, begun, where)
    units = _table(student, "units", begun, where)
    model = student_model(student, substeps=substeps)
    simulated = structure_of_model(model).respond
    states = len(model.initial_state)

    def respond(t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
        try:
            return simulated(t, u, x0, values)
        except InputError:
            raise
        except STUDENT_ERRORS as error:
            tried = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
            raise InputError(
                f"the model fails with {tried}: {student_error(error, student.source)}; correct it, or give bounds "
                "that keep such values away",
                where,
            ) from error

    def start(logs: Sequence[Log]) -> list[tuple[dict[str, float], list[tuple[float, ...]]]]:
        rest = tuple(float(value) for value in model.initial_state)[2:]
        return [(dict(begun), [(*first_state(structure, log)[:2], *rest) for log in logs])]

    def prepare(logs: Sequence[Log]) -> Structure:
        return _quicker(student, path, structure, begun, logs)

    structure = Structure(
        name=where,
        parameters={name: Quantity("a parameter of the file", low=bounds[name][0]) for name in begun},
        units={name: str(units.get(name, "")) for name in begun},
        states=states,
        respond=respond,
        at_most={name: high for name, (_, high) in bounds.items() if high < inf},
        state_names=("position", "velocity", *(f"state {i + 1}" for i in range(2, states)))[:states],
        start=start,
        prepare=prepare if "derivatives" in student.functions and substeps == SUBSTEPS else None,
    )
    return structure


def _quicker(
    student: StudentFile, path: str | Path, structure: Structure, begun: Mapping[str, float], logs: Sequence[Log]
) -> Structure:
    """The structure with the fewest Runge-Kutta steps that change its free run by a tenth of the noise at most."""
    part = excited_part(logs[0], _TRIED)
    noise = motion_of(part).noise
    state = first_state(structure, part)
    with np.errstate(all="ignore"):
        exact = structure.respond(part.time, part.command, state, begun)
        for substeps in _COARSER:
            coarse = _structure(student, path, substeps)
            off = np.abs(coarse.respond(part.time, part.command, state, begun) - exact).max()
            if off <= _CLOSE * noise:
                return coarse
    return structure


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _bounds(student: StudentFile, begun: Mapping[str, float], where: str) -> dict[str, tuple[float, float]]:
    bounds = dict.fromkeys(begun, (-inf, inf))
    for name, pair in _table(student, "bounds", begun, where).items():
        try:
            low, high = (float(value) for value in pair)
        except (TypeError, ValueError):
            raise InputError(f"bounds[{name!r}] = {pair!r:.60} must be two numbers, as in (0.0, 1.0)", where) from None
        if not low < high:
            raise InputError(f"bounds[{name!r}] = {pair!r}: the first must be less than the second", where)
        if not low <= begun[name] <= high:
            raise InputError(f"params[{name!r}] = {begun[name]:g} lies outside its bounds, {low:g} to {high:g}", where)
        bounds[name] = (low, high)
    return bounds


def _table(student: StudentFile, word: str, begun: Mapping[str, float], where: str) -> Mapping[str, Any]:
    """The file's own `bounds` or `units`, if it defines them."""
    function = next(iter(student.functions.values()))
    table = getattr(function, "__globals__", {}).get(word, {})
    if not isinstance(table, Mapping):
        raise InputError(f"{word} is {table!r:.60}; it must be a dict by the parameters' names", where)
    for name in table:
        if name not in begun:
            raise InputError(f"{word} names {name!r}, which params does not hold; it holds {', '.join(begun)}", where)
    return table
