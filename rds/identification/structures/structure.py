"""Model structures: which parameters a model has, and how it answers a log's commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from rds.core.quantities import Quantity
from rds.identification.logs.log import RATES
from rds.identification.structures import SIMULATION_ERROR

if TYPE_CHECKING:
    from rds.identification.logs.log import Log

PLAY = "place in the play"  # the state that says where in a backlash the motor is, from -1 to 1


class Response(Protocol):
    """A structure's answer to the commands `u` held from each of the times `t` (s) to the next.

    Returns the output at each time, in `output_unit` for commands in `command_unit`, from the initial state `x0`.
    """

    def __call__(self, t: np.ndarray, u: np.ndarray, x0: Sequence[float], values: Mapping[str, float]) -> np.ndarray:
        """The outputs."""
        ...


Start = tuple[dict[str, float], list[tuple[float, ...]]]  # values, and an initial state for each log


class HiddenParameter(NamedTuple):
    """A parameter that logs hardly show: what is to be known to fit the others without it."""

    value: float  # at which it certainly shows nothing
    likely: Callable[[Mapping[str, float]], Sequence[float]]  # from the fit's values: what it may be, likeliest first


class Blocks(NamedTuple):
    """Stretches of a log, in each of which a model is to land at a position by a constant extra voltage."""

    firsts: np.ndarray  # (m,) samples at which they begin
    length: int  # samples
    states: np.ndarray  # (m, states) at their begin
    ends: np.ndarray  # (m,) outputs at their end
    trial: float  # V: the first voltage that is tried, beside 0
    far: float  # V: none beyond it
    rounds: int  # of the search, at most


@dataclass(frozen=True)
class Structure:
    """A parametrized model of an axis, ready to be fitted, simulated, validated or written as a model file."""

    name: str
    parameters: Mapping[str, Quantity]  # meaning with unit, and bounds
    units: Mapping[str, str]
    states: int
    respond: Response
    options: tuple[str, ...] = ()
    # outputs and their derivatives by parameter and initial state: (samples,), (samples, parameters + states);
    # called as `respond` is; without it, a fit takes finite differences
    sensitivities: Callable[..., tuple[np.ndarray, np.ndarray]] | None = None
    # the extra voltage of each of these blocks (m,), NaN where none is found, at once: `lands(t, u, blocks, values)`;
    # without it, block by block with `respond`
    lands: Callable[[np.ndarray, np.ndarray, Blocks, Mapping[str, float]], np.ndarray] | None = None
    # the `[model]` table or machine parameters that say the same to a run; None where no library model does
    as_model: Callable[[Mapping[str, float]], dict[str, Any]] | None = None
    at_most: Mapping[str, float] = field(default_factory=dict)  # upper bounds of parameters, where there are any
    state_names: tuple[str, ...] = ("position", "velocity")
    state_bounds: tuple[tuple[float, float], ...] = ()  # of each initial state; none where empty
    # values to begin a fit with, best first, and an initial state for each log; InputError where the data hold none
    start: Callable[[Sequence[Log]], Iterable[Start]] | None = None
    output_unit: str = "mm"
    command_unit: str = "V"
    # parameters that only make sense held at a value unless another is held, with the sentence that says so
    held: Callable[[frozenset[str]], Mapping[str, tuple[float, str]]] | None = None

    def __repr__(self) -> str:
        options = f" with {', '.join(self.options)}" if self.options else ""
        return f"<Structure {self.name}{options}: {', '.join(self.parameters)}>"

    # parameters that the logs state and no fit can tell (a force per volt), held at these values, with 0 std error
    given: Callable[[Sequence[Log]], Mapping[str, float]] | None = None
    default_method: str = SIMULATION_ERROR  # the method where the user names none
    # parameters that these logs have little occasion to tell (friction of a direction in which the axis hardly moves),
    # given values to begin with
    idle: Callable[[Sequence[Log], Mapping[str, float]], Mapping[str, HiddenParameter]] | None = None
    neutral: Mapping[str, float] = field(default_factory=dict)  # values at which what options add has no effect
    # the same structure in a form that answers these logs sooner, as exactly as their noise asks
    prepare: Callable[[Sequence[Log]], Structure] | None = None
    no_effect: Mapping[str, str] = field(default_factory=dict)  # what it means that a parameter changes nothing

    @property
    def is_rate(self) -> bool:
        """Whether the output is a speed."""
        return self.output_unit in RATES

    def bounds(self, name: str) -> tuple[float, float]:
        """The lowest and the highest value that the parameter may take."""
        option = self.parameters[name]
        return max(option.low, option.above), self.at_most.get(name, inf)
