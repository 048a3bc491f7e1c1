"""Any model, a library's or a student's, as a structure: its numbers are the parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any

import numpy as np

from rds.core.quantities import Quantity
from rds.core.types import Model
from rds.identification.structures.structure import Structure


def structure_of_model(model: Model, unit: str = "mm") -> Structure:
    """The structure with the model's own simulation, sample by sample; `unit` is that of its output."""
    numbers = {key: value for key, value in model.params.items() if isinstance(value, int | float)}
    names = [key for key, value in numbers.items() if not isinstance(value, bool)]

    def respond(t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
        return _responded(model, {**model.params, **values}, t, u, x0)

    states = len(model.initial_state)
    state_names = ("position", "velocity", *(f"state {i + 1}" for i in range(2, states)))[:states]
    return Structure(
        name=model.source.name,
        parameters={key: Quantity(key) for key in names},
        units=dict.fromkeys(names, ""),
        states=states,
        respond=respond,
        state_names=state_names if states > 1 else ("output",),
        output_unit=unit,
    )


def _responded(
    model: Model, params: Mapping[str, Any], t: np.ndarray, u: np.ndarray, x0: Sequence[float]
) -> np.ndarray:
    """Outputs at the times; NaN from where the model's state or output is no longer finite."""
    state: Sequence[float] = [float(value) for value in x0]
    outputs = np.full(len(t), np.nan)
    times, steps = t.tolist(), np.diff(t).tolist()
    for k, voltage in enumerate(u.tolist()):
        outputs[k] = model.seen(state, params, times[k])
        if k == len(steps) or not isfinite(outputs[k]):
            break
        try:
            state = model.moved(state, voltage, steps[k], params, times[k])
        except (OverflowError, ZeroDivisionError):
            break
    return outputs
