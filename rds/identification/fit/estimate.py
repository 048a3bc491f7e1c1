"""What a fit found: parameters with their uncertainty, how well they explain the data, and what to be wary of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isinf
from typing import Any

import numpy as np

_NAMED = 4  # logs that a sentence names
UNUSABLE = "do not use these parameters"  # how a warning begins that leaves nothing to believe in


@dataclass(frozen=True)
class Parameter:
    """One estimated number, with its 95 % confidence interval [low, high].

    The standard error is 0 for a number that was held, and infinite for one that the data do not tell.
    """

    value: float
    std_error: float
    low: float
    high: float
    unit: str

    @property
    def told(self) -> bool:
        """Whether the data tell it; if not, its value is assumed."""
        return not isinf(self.std_error)

    @property
    def wide(self) -> bool:
        """Whether the interval is wider than the value: the data hardly tell it."""
        return self.std_error > 0.0 and self.high - self.low > abs(self.value)


def guesses(parameters: Mapping[str, Parameter]) -> list[str]:
    """The names of those that the data do not tell."""
    return [name for name, parameter in parameters.items() if not parameter.told]


def in_a_line(parameters: Mapping[str, Parameter]) -> str:
    """The values with their units."""
    return ", ".join(f"{name} = {p.value:.6g} {p.unit}".rstrip() for name, p in parameters.items())


def said_of_guesses(parameters: Mapping[str, Parameter]) -> list[str]:
    """A sentence that names the parameters whose values are guesses; none where the data tell all of them."""
    said = [f"{name} = {parameters[name].value:.3g} {parameters[name].unit}".rstrip() for name in guesses(parameters)]
    if not said:
        return []
    which = "its value is assumed" if len(said) == 1 else "their values are assumed"
    return [f"not determined by the data that were fitted: {', '.join(said)}; {which}"]


@dataclass(frozen=True)
class Errors:
    """Model minus measurement over one log, in one way of predicting."""

    fit_percent: float  # 100 (1 - |y - ŷ| / |y - mean y|)
    rmse: float  # in `unit`
    maximum: float  # in `unit`
    unit: str


@dataclass(frozen=True)
class Estimate:
    """The answer of a fit. `covariance` and `correlation` are in the order of `parameters`."""

    structure: str  # axis, axis-mass, spindle, or a student's file
    options: tuple[str, ...]  # viscous, stribeck, offset, dead-zone, delay, backlash
    method: str  # simulation, inverse-dynamics, step, frequency
    parameters: Mapping[str, Parameter]
    covariance: np.ndarray
    unidentifiable: tuple[str, ...]  # sentences: parameters (or combinations) that these data cannot tell
    initial_state: Mapping[str, tuple[float, ...]]  # per log, estimated
    free_run: Mapping[str, Errors]  # per log
    ahead: Mapping[str, Mapping[int, Errors]]  # per log and number of steps predicted ahead
    logs: tuple[Mapping[str, Any], ...]  # {name, source, sha256, first, end} of each stretch that was fitted
    relative_error_percent: float | None = None  # |force or voltage - its model| / |it|
    warnings: tuple[str, ...] = ()
    details: Mapping[str, Any] = field(default_factory=dict)  # of the method: iterations, noise, decimation, ...
    output_unit: str = "mm"  # of what the structure answers
    command_unit: str = "V"  # of what commands it

    @property
    def correlation(self) -> np.ndarray:
        """Between the parameters, from -1 to 1; NaN where a parameter has no uncertainty."""
        scale = np.sqrt(np.diag(self.covariance))
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.covariance / np.outer(scale, scale)

    def values(self) -> dict[str, float]:
        """The estimates by name."""
        return {name: parameter.value for name, parameter in self.parameters.items()}

    def unusable(self) -> list[str]:
        """The warnings that leave nothing to believe in."""
        return [sentence for sentence in self.warnings if UNUSABLE in sentence]

    def to_json(self) -> dict[str, Any]:
        """As a dict that JSON can hold, as `rds fit --json` prints it."""
        from rds.identification.fit.estimate_json import to_json

        return to_json(self)

    def __repr__(self) -> str:
        return f"<Estimate of {self.structure} by {self.method}: {in_a_line(self.parameters)}>"

    def __str__(self) -> str:
        from rds.identification.fit.estimate_json import as_text

        return as_text(self)

    def _repr_html_(self) -> str:
        from rds.identification.fit.fit_report import fragment

        return fragment(self)


def names_of(names: Sequence[str]) -> str:
    """Names of logs, the first ones of many."""
    named = ", ".join(dict.fromkeys(names[:_NAMED]))
    return f"{named} and {len(names) - _NAMED} more" if len(names) > _NAMED else named
