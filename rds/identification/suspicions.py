"""What should make the reader of a simulation-error fit doubt it, in sentences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rds.identification.estimate import UNUSABLE
from rds.identification.problem import Problem
from rds.identification.smoothing import motion_of
from rds.identification.solve import Solution
from rds.identification.uncertainty import Uncertainty

_TWINS = 0.99  # correlation from which two parameters are told together rather than each
_POOR = 90.0  # per cent: a model that fits worse does not explain the motion
_MISSED = 1.5  # times the measurement's noise: residuals that are larger hold something else
_LITTLE = 100.0  # times the measurement's noise: with less motion than that, a fit is not told by much
_WHITE = 2.576  # 99 % band, in units of 1/√N
_TIMES = (1e-4, 10.0)  # s: time constants of the axes of machine tools
_SPEEDS = (0.05, 5000.0)  # mm/s: the highest speed of a log
_LAGS = (1, 10, 100)


def suspicions(problem: Problem, solution: Solution, uncertainty: Uncertainty) -> list[str]:
    """Sentences with numbers, units and what to look at."""
    values = problem.values(solution.point)
    said = [*_search(problem, solution), *_implausible(problem, values)]
    for number in range(len(problem.logs)):
        said += _residuals(problem, solution, number)
    return said + _twins(problem.names, uncertainty)


def _search(problem: Problem, solution: Solution) -> list[str]:
    said = []
    if not solution.converged:
        said.append(
            f"{UNUSABLE} yet: the search had not settled after {solution.evaluations} free runs; the "
            "values are the best so far, and the intervals are widened by what seemed left to go. Give other values to "
            "start from (--start), hold a parameter (--fix), or fit fewer options"
        )
    values = problem.values(solution.point)
    for name, side in zip(problem.names, solution.at_bound, strict=False):
        if side:
            said.append(
                f"{name} = {values[name]:.4g} lies at its bound ({problem.structure.parameters[name].meaning}): the "
                "data ask for a value beyond it, so the structure, a sign or a unit is wrong"
            )
    return said


def _implausible(problem: Problem, values: Mapping[str, float]) -> list[str]:
    said = []
    K, tau = values.get("K"), values.get("tau")
    if K is not None and K < 0.0:
        said.append(
            f"K = {K:.4g} {problem.structure.units['K']} is negative: a positive command moves the axis backward. Is "
            "the sign of the command or of the position reversed?"
        )
    if tau is not None and not _TIMES[0] <= tau <= _TIMES[1]:
        said.append(
            f"tau = {tau:.3g} s is no time constant of an axis ({_TIMES[0]:g} to {_TIMES[1]:g} s): is the time in "
            "seconds, and are the columns the right ones?"
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


def _residuals(problem: Problem, solution: Solution, number: int) -> list[str]:
    log = problem.logs[number]
    error, _ = problem.residuals(solution.point, number)
    size = float(np.sqrt(np.mean(error**2)))
    unit = problem.structure.output_unit
    said = []
    spread = float(log.position.std())
    fit = 100.0 * (1.0 - float(error.std()) / spread) if spread > 0.0 else 0.0
    noise = motion_of(log).noise
    reach = float(np.ptp(log.position))
    if reach < _LITTLE * noise:
        said.append(
            f"{log.name}: the axis moves by {reach:.3g} {unit} in all, only {reach / noise:.0f} times the "
            f"measurement's noise ({noise:.2g} {unit}): intervals hold for errors that are small beside the motion, "
            "and may be too narrow here; record more motion"
        )
    if fit < _POOR and size > _MISSED * noise:
        said.append(
            f"{log.name}: the free run explains {fit:.1f} % of the motion only: {UNUSABLE}; look at the "
            "data with `rds data describe` (columns, signs, units), and try other options or structures"
        )
    if noise > 0.0 and size > _MISSED * noise:
        said.append(
            f"{log.name}: the residuals ({size:.3g} {unit} RMS) are {size / noise:.3g} times the measurement's noise "
            f"({noise:.2g} {unit}): the machine does something that structure {_named(problem)} lacks. The intervals "
            "count the residuals' correlation, but not that the parameters make up for what is missing"
        )
    correlation = _autocorrelation(error)
    band = _WHITE / np.sqrt(len(error))
    beyond = {lag: value for lag, value in correlation.items() if abs(value) > 2.0 * band}
    if beyond and (noise == 0.0 or size > _MISSED * noise):
        values = ", ".join(f"{value:.2f} at {lag}" for lag, value in beyond.items())
        said.append(
            f"{log.name}: the residuals are not white (autocorrelation {values} samples' distance; 99 % band "
            f"±{band:.3f}): parameters that fit this log may not fit another"
        )
    return said


def _named(problem: Problem) -> str:
    options = problem.structure.options
    name = Path(problem.structure.name).name
    return f"{name} with {', '.join(options)}" if options else name


def _autocorrelation(error: np.ndarray) -> dict[int, float]:
    e = error - error.mean()
    power = float(e @ e)
    return {lag: float(e[lag:] @ e[:-lag]) / power for lag in _LAGS if lag < len(e) // 4 and power > 0.0}


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
        f"{', '.join(together[:-1])} and {together[-1]} are told together far better than each "
        f"({strongest[0]} and {strongest[1]} are correlated {pairs[strongest]:+.4f}): a change of one makes up for a "
        "change of the other; logs with other amplitudes and frequencies would narrow them (`rds excite`)"
    ]
