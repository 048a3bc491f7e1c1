"""Whether logs that were fitted together contradict each other: what each by itself would say of the parameters.

From the values that fit all of them best, one Gauss-Newton step on a single log goes to what that log says alone, with
a standard error of its own. Two logs that differ by far more than these errors are of two axes, loads or temperatures,
or one of them is at fault; what was fitted to both is true of neither.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import hypot

import numpy as np

from rds.identification.fit.problem import Problem
from rds.identification.fit.residuals import effective_samples
from rds.identification.fit.solve import Solution
from rds.identification.logs.excitation import is_at_rest

_APART = 6.0  # standard errors of both, of which a linear step makes too little
_MATTERS = 0.03  # of the value: contradictions that are smaller mean nothing to a loop
_WHOLE = 1.0 - 1e-3  # of a parameter that a log tells by itself, and not only together with another one
_SURE = 0.2  # of the value: a log whose error is larger does not say


def contradictions(problem: Problem, solution: Solution) -> Iterator[str]:
    """A sentence for each parameter of which two logs say different things: those that differ most."""
    if len(problem.logs) < 2 or not problem.names:
        return
    alone = [_alone(problem, solution, number) for number in range(len(problem.logs))]
    for at, name in enumerate(problem.names):
        both_say = problem.values(solution.point)[name]
        size = abs(both_say)
        known = [
            (i, value[at], error[at])
            for i, (value, error) in enumerate(alone)
            if error[at] <= _SURE * size and abs(value[at] - both_say) <= size  # farther no linear step goes
            if not is_at_rest(problem.logs[i])
        ]
        pairs = [
            (abs(a - b) / spread, (i, a), (j, b))
            for (i, a, ea), (j, b, eb) in combinations(known, 2)
            if (spread := hypot(ea, eb)) > 0.0 and abs(a - b) > max(_APART * spread, _MATTERS * size)
        ]
        if not pairs:
            continue
        times, *both = max(pairs)
        unit = problem.structure.units[name]
        said = " and ".join(f"{problem.logs[i].name} {value:.4g} {unit}".rstrip() for i, value in both)
        yield (
            f"the logs contradict each other about {name}: by itself, {said} ({times:.0f} standard errors apart): the "
            "axis, its load or its temperature was another, or one log is at fault; fit them apart"
        )


def _alone(problem: Problem, solution: Solution, number: int) -> tuple[np.ndarray, np.ndarray]:
    """The parameters that one log asks for, to first order, and their standard errors (infinite: it does not tell)."""
    error, by = problem.residuals(solution.point, number)
    n = len(problem.names)
    scale = np.linalg.norm(by, axis=0)
    used = scale > 0.0
    values, errors = solution.point[:n].copy(), np.full(n, np.inf)
    J = by[:, used] / scale[used]
    step, *_ = np.linalg.lstsq(J, error, rcond=1e-9)
    left = error - J @ step
    variance = float(left @ left) / max(effective_samples(left), 1.0)
    inverse = np.linalg.pinv(J.T @ J, rcond=1e-12)
    told = np.diag(inverse @ (J.T @ J)) > _WHOLE
    for column, place in enumerate(np.flatnonzero(used).tolist()):
        if place < n and told[column]:
            values[place] += step[column] / scale[place]
            errors[place] = float(np.sqrt(max(variance * inverse[column, column], 0.0))) / scale[place]
    return values, errors
