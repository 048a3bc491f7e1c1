"""Least squares by scipy over a problem."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.identification.fit.problem import Problem
from rds.identification.logs.log import Log
from rds.identification.structures.structure import Structure

EVALUATIONS = 150  # at most, and for each parameter beyond four
MORE = 50
_SINGULAR = 1e7  # condition number of the scaled derivatives
# A step that lowers the sum of squares by less than this share of one residual's variance moves no number by more than
# a hundredth of its standard error.
_NEGLIGIBLE = 1e-4


@dataclass(frozen=True)
class Solution:
    """Where least squares ended. `triangle` is R (n + 1, n + 1) of [J r] there."""

    point: np.ndarray
    triangle: np.ndarray
    evaluations: int
    converged: bool
    at_bound: np.ndarray  # -1, 0 or 1 for each free number

    @property
    def squares(self) -> float:
        """The sum of squared residuals."""
        return float(self.triangle[:, -1] @ self.triangle[:, -1])

    @property
    def step(self) -> np.ndarray:
        """How far the least squares still are, were the free run linear in the numbers (n)."""
        return np.linalg.lstsq(self.triangle[:, :-1], self.triangle[:, -1], rcond=1e-7)[0]


def least_squares(problem: Problem, start: np.ndarray, most: int | None = None) -> Solution:
    """The point with the least squared residuals near `start`, after `most` free runs at most (150 and more if None).

    InputError if the free run there is not finite.
    """
    with needed_for("a fit"):
        from scipy.optimize import least_squares as minimize

    low, high = problem.bounds()
    start = np.clip(start, low, high)
    last: list[tuple[np.ndarray, np.ndarray]] = []

    def triangle(point: np.ndarray) -> np.ndarray:
        if not last or not np.array_equal(last[0][0], point):
            last[:] = [(point.copy(), problem.triangle(point))]
        return last[0][1]

    if not np.isfinite(triangle(start)).all():
        values = ", ".join(f"{name} = {value:.4g}" for name, value in problem.values(start).items())
        raise InputError(
            f"structure {problem.structure.name}: its free run leaves the finite numbers at {values}; give it better "
            "values to start from, or check its derivatives"
        )
    if not problem.size:
        return Solution(start, triangle(start), 1, True, np.zeros(0))
    samples = sum(len(log) for log in problem.logs)

    def residuals(point: np.ndarray) -> np.ndarray:
        R = triangle(point)
        if _settled(R, samples) and (point > low).all() and (point < high).all():
            raise _Settled
        return R[:, -1]

    def derivatives(point: np.ndarray) -> np.ndarray:
        return -triangle(point)[:, :-1]

    def search(method: Literal["dogbox", "trf"]) -> Solution:
        begun = problem.runs
        try:
            found = minimize(
                residuals,
                start,
                jac=derivatives,
                bounds=(low, high),
                method=method,
                x_scale="jac",
                ftol=float(np.clip(_NEGLIGIBLE / samples, 1e-13, 1e-6)),
                xtol=1e-9,
                gtol=1e-12,
                max_nfev=most or EVALUATIONS + MORE * max(len(problem.names) - 4, 0),
            )
        except _Settled:
            ((point, R),) = last
            return Solution(point, R, problem.runs - begun, True, np.zeros(len(point)))
        return Solution(found.x, triangle(found.x), int(found.nfev), bool(found.success), np.asarray(found.active_mask))

    # The dogleg needs little more than half the free runs of the reflective method, but ends anywhere where a direction
    # is not told, and may stay at a bound. Initial states alone have nowhere else to go: one that is not told, as the
    # velocity of an axis that sticks, changes nothing.
    quick = search("dogbox")
    if quick.converged and not quick.at_bound.any() and (not problem.names or tells_all(quick.triangle)):
        return quick
    sure = search("trf")
    return sure if sure.squares <= quick.squares else quick


class _Settled(Exception):
    """The search is at its end, and need not try one more step to see that."""


def _settled(triangle: np.ndarray, samples: int) -> bool:
    """Whether the step to the least squares, were the free run linear, would lower them by next to nothing."""
    lowered, all_of = float(triangle[:-1, -1] @ triangle[:-1, -1]), float(triangle[:, -1] @ triangle[:, -1])
    return lowered <= _NEGLIGIBLE * all_of / samples and tells_all(triangle)


def tells_all(triangle: np.ndarray) -> bool:
    """Whether every direction of the free numbers shows in the residuals."""
    R = triangle[:, :-1]
    size = np.linalg.norm(R, axis=0)
    return bool(size.all() and np.linalg.cond(R / size) < _SINGULAR)


def first_state(structure: Structure, log: Log) -> tuple[float, ...]:
    """A state to begin with: the first measurement, its smoothed velocity, and 0 for what else there is."""
    from rds.identification.fit.smoothing import motion_of

    first = float(log.position[0])
    if structure.states < 2 or structure.state_names[1] != "velocity":
        return (first, *([0.0] * (structure.states - 1)))[: structure.states]
    motion = motion_of(log)
    speed = float(motion.velocity[0])
    return (first, speed if abs(speed) > motion.threshold else 0.0, *([0.0] * (structure.states - 2)))
