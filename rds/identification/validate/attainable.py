"""How near a model's structure comes to a log with other parameters: what the noise allows, and the model misses.

A residual test cannot see this. It allows for the uncertainty of the parameters that the fit has stated, and methods
that do not fit the free run state too little of it, or so much that any residual looks like chance: with derivatives
of a noisy position a time constant comes out a fifth too short, and the free run is still within its band. So the same
parameters are fitted to the log itself, by simulation error, beginning at the model's. That fit serves as a measure
only: it has seen the log, and is no model to use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot, isfinite

import numpy as np

from rds.core.errors import InputError
from rds.identification.fit.estimate import Parameter
from rds.identification.logs.log import Log, excited_part
from rds.identification.validate.candidate import Candidate

_LONGEST = 200_000  # samples that are fitted
_RUNS = 60  # free runs of the search, at most


@dataclass(frozen=True)
class Refitted:
    """One parameter: the model's value, and what the log by itself says, with its standard error.

    `apart` is in standard errors of both.
    """

    name: str
    model: float
    here: float
    error: float
    unit: str
    apart: float


@dataclass(frozen=True)
class Attainable:
    """RMSE of the free run with the model's parameters, and with those that fit this log best, the initial state
    estimated over the whole log for both; in the unit of the position. `noise` is the measurement's, which no free run
    undercuts for long. `samples` of the log were fitted.
    """

    rmse: float
    reached: float
    noise: float
    samples: int
    parameters: tuple[Refitted, ...]

    @property
    def ratio(self) -> float:
        """How many times farther off the model is than it need be; infinite where there is no noise at all."""
        least = max(self.reached, self.noise)
        return self.rmse / least if least > 0.0 else float("inf")


def attainable(candidate: Candidate, log: Log, start: tuple[float, ...], noise: float) -> Attainable | None:
    """The least RMSE that the structure reaches on 200,000 samples of `log` at most, those from where its command first
    changes; the search begins at the initial state `start`, and `noise` is the measurement's.

    None where that says nothing: a closed loop (a free run lacks the controller), a model without estimated parameters,
    or one whose derivatives are not known (a student's file, for which a search would take minutes).
    """
    from rds.identification.fit.problem import Problem
    from rds.identification.fit.solve import least_squares
    from rds.identification.fit.uncertainty import uncertainty_of

    names, structure = candidate.estimated, candidate.structure
    if log.closed_loop or not names or structure.sensitivities is None:
        return None
    part = excited_part(log, _LONGEST)
    held = {name: value for name, value in candidate.values.items() if name not in names}
    try:
        alone = Problem([part], structure, candidate.values)
        state = least_squares(alone, np.array(start), _RUNS)
        free = Problem([part], structure, held)
        found = least_squares(free, np.concatenate([free.point(candidate.values, []), state.point]), _RUNS)
    except InputError:  # the free run is not finite
        return None
    values, covariance = free.values(found.point), uncertainty_of(free, found).covariance
    errors = dict(zip(free.names, np.sqrt(np.diag(covariance)).tolist(), strict=False))
    return Attainable(
        rmse=alone.rms(state.squares),
        reached=free.rms(found.squares),
        noise=noise,
        samples=len(part),
        parameters=tuple(
            _compared(name, candidate.parameters, values[name], errors[name], structure.units[name])
            for name in free.names
        ),
    )


def _compared(name: str, stated: Mapping[str, Parameter], here: float, error: float, unit: str) -> Refitted:
    model = stated[name]
    spread = hypot(model.std_error, error)
    apart = abs(model.value - here) / spread if isfinite(spread) and spread > 0.0 else 0.0
    return Refitted(name, model.value, here, error, unit, apart)
