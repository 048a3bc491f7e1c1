"""How far a parameter can go before the residuals grow by more than chance, the others fitted anew each time.

Standard errors take the free run for linear in the parameters over the width of an interval. Where the motion is not
large beside the noise it is not: an axis that creeps one way under one voltage tells K u - F only, a fit may end at any
K, and the derivatives there promise an interval that is far from the truth. The profile of the sum of squares does not
rely on them: with one parameter held, S - S_min is below t² s² for a value within the interval (s² the variance of an
independent residual). So the interval is followed outward until that is exceeded.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rds.identification.fit.problem import Problem
from rds.identification.fit.solve import least_squares

_FARTHEST = 32.0  # times the interval by the derivatives: beyond it, the data leave the parameter open
_RUNS = 40  # free runs for one value


def widening(
    problem: Problem, point: np.ndarray, squares: float, reaches: Mapping[str, float], allowed: float
) -> dict[str, float]:
    """By what factor the half-widths `reaches` of parameters of `problem` must grow; infinite where no end is found.

    `squares` is the sum of squares at `point`, and `allowed` what it may grow by.
    """
    return {
        name: max(_end(problem, point, squares, name, side * reach, allowed) for side in (-1.0, 1.0))
        for name, reach in reaches.items()
    }


def _end(problem: Problem, point: np.ndarray, squares: float, name: str, reach: float, allowed: float) -> float:
    """Where, in units of `reach`, the sum of squares has grown by `allowed`; 1 at least."""
    place = problem.names.index(name)
    low, high = (bound[place] for bound in problem.bounds())
    start = np.delete(point, place)
    before, grown = 0.0, 0.0
    far = 1.0
    while far <= _FARTHEST:
        value = float(np.clip(point[place] + far * reach, low, high))
        is_end = value in (low, high)  # it can go no farther
        far = (value - float(point[place])) / reach if is_end else far
        held = Problem(problem.logs, problem.structure, {**problem.fixed, name: value})
        solution = least_squares(held, start, _RUNS)
        more = solution.squares - squares
        if more > allowed:
            share = (allowed - grown) / (more - grown)
            return max(before + (far - before) * share, 1.0)
        if is_end:
            return max(far, 1.0)
        start, before, grown = solution.point, far, max(more, 0.0)
        far *= 2.0
    return float("inf")
