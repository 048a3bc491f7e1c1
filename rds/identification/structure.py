"""Model structures: which parameters a model has, and how it answers a log's commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rds.core.options import Option


class Response(Protocol):
    """A structure's answer to the commands `u` (V) held from each of the times `t` (s) to the next.

    Returns the output at each time (mm; a spindle's speed in rev/min), from the initial state `x0`.
    """

    def __call__(self, t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
        """The outputs."""
        ...


@dataclass(frozen=True)
class Structure:
    """A parametrized model of an axis, ready to be fitted, simulated, validated or written as a model file."""

    name: str
    parameters: Mapping[str, Option]  # meaning with unit, and bounds
    units: Mapping[str, str]
    states: int
    respond: Response
    options: tuple[str, ...] = ()
    # outputs and their derivatives by parameter and initial state: (samples,), (samples, parameters + states)
    sensitivities: Callable[..., tuple[np.ndarray, np.ndarray]] | None = None
    # the `[model]` table or machine parameters that say the same to a run; None where no library model does
    as_model: Callable[[Mapping[str, float]], dict[str, Any]] | None = None
