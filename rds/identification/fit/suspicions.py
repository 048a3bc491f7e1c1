"""What should make the reader of a simulation-error fit doubt it, in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rds.identification.fit.contradiction import contradictions
from rds.identification.fit.estimate import UNUSABLE
from rds.identification.fit.free_run_doubts import fitted_doubts
from rds.identification.fit.smoothing import motion_of
from rds.identification.fit.upsets import upsets
from rds.identification.logs.slips import late

if TYPE_CHECKING:
    from rds.identification.fit.problem import Problem
    from rds.identification.fit.solve import Solution
    from rds.identification.fit.uncertainty import Uncertainty

_OF_TAU = 0.5  # of the sample period: a time constant that is shorter is told by no log
_TWINS = 0.99  # correlation from which two parameters are told together rather than each
_TIMES = (1e-4, 10.0)  # s: time constants of the axes of machine tools
_SPEEDS = (0.05, 5000.0)  # mm/s: the highest speed of a log
_WITHIN = 3.0  # standard errors by which noise alone asks for a value beyond a bound


def suspicions(
    problem: Problem, solution: Solution, uncertainty: Uncertainty, errors: Mapping[str, float]
) -> list[str]:
    """Sentences with numbers, units and what to look at; `errors` are the standard errors of the parameters."""
    values = problem.values(solution.point)
    said = [*_search(problem, solution, errors), *_implausible(problem, values), *contradictions(problem, solution)]
    for number, log in enumerate(problem.logs):
        error = problem.residuals(solution.point, number)[0]
        said += fitted_doubts(problem.structure, log, error)
        noise, unit = motion_of(log).noise, problem.structure.output_unit
        found = upsets(log.time, error, noise, unit, log.position - error, log.resolution, late(log))
        said += [f"{log.name}: {sentence}" for sentence in found]
    return said + _twins(problem.names, uncertainty)


def _search(problem: Problem, solution: Solution, errors: Mapping[str, float]) -> list[str]:
    said = []
    if not solution.converged:
        said.append(
            f"{UNUSABLE} yet: the search had not settled after {solution.evaluations} free runs; the "
            "values are the best so far, and the intervals are widened by what seemed left to go. Give other values to "
            "start from (--start), hold a parameter (--fix), or fit fewer options"
        )
    for name, side, beyond in zip(problem.names, solution.at_bound, solution.step, strict=False):
        if side:
            meaning = problem.structure.parameters[name].described
            if name in problem.structure.neutral and side < 0:
                conclusion = "these data show nothing of it; fit without that option"
            elif abs(beyond) > _WITHIN * errors[name]:
                conclusion = "the data ask for a value beyond it, so the structure, a sign or a unit is wrong"
            else:  # as of an axis without friction
                continue
            bound = problem.structure.bounds(name)[0 if side < 0 else 1]
            said.append(f"{name} = {bound:.4g} lies at its bound ({meaning}): {conclusion}")
    return said


def _implausible(problem: Problem, values: Mapping[str, float]) -> list[str]:
    said = []
    K, tau = values.get("K"), values.get("tau")
    if K is not None and K < 0.0:
        said.append(
            f"K = {K:.4g} {problem.structure.units['K']} is negative: a positive command moves the axis backward. Is "
            "the sign of the command or of the position reversed?"
        )
    slow = max(log.sample_period for log in problem.logs) > _TIMES[0] / _OF_TAU
    if tau is not None and (tau > _TIMES[1] or (tau < _TIMES[0] and not slow)):
        said.append(
            f"tau = {tau:.3g} s is no time constant of an axis ({_TIMES[0]:g} to {_TIMES[1]:g} s): {UNUSABLE}. Is the "
            "time in seconds, are the columns the right ones, and does the structure have what the axis does?"
        )
    if problem.structure.output_unit == "mm":
        for log in problem.logs:
            fastest = float(np.abs(motion_of(log).velocity).max())
            if not _SPEEDS[0] <= fastest <= _SPEEDS[1]:
                said.append(
                    f"{log.name}: the axis moves at {fastest:.3g} mm/s at most, and axes do at {_SPEEDS[0]:g} to "
                    f"{_SPEEDS[1]:g} mm/s: is the position in mm, and the time in s?"
                )
    return said


def _twins(names: Sequence[str], uncertainty: Uncertainty) -> list[str]:
    """One sentence: the parameters that are told together rather than each, and the strongest correlation."""
    error = np.sqrt(np.diag(uncertainty.covariance))
    pairs = {}
    for i, name in enumerate(names):
        for j in range(i):
            if np.isfinite(error[i] + error[j]) and error[i] * error[j] > 0.0:
                correlation = float(uncertainty.covariance[i, j] / (error[i] * error[j]))
                if abs(correlation) > _TWINS:
                    pairs[names[j], name] = correlation
    if not pairs:
        return []
    strongest = max(pairs, key=lambda pair: abs(pairs[pair]))
    together = [name for name in names if any(name in pair for pair in pairs)]
    return [
        f"{', '.join(together[:-1])} and {together[-1]} are strongly correlated "
        f"({strongest[0]} and {strongest[1]} by {pairs[strongest]:+.4f}): the data determine their combination much "
        "better than each alone. Add logs with other amplitudes and frequencies (`rds excite`)"
    ]
