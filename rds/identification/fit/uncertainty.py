"""How far estimates may be off: covariance that holds for correlated, uneven and quantized residuals.

At the least-squares point, with J the derivatives of the free run and r the residuals,

    cov θ = (JᵀJ)⁻¹ S (JᵀJ)⁻¹,      S = Σ over overlapping blocks of L samples of (Σ J r)(Σ J r)ᵀ / L

(the estimator of Newey and West, as sums over blocks; L is four times the time over which the residual is correlated).
Where the encoder's step is most of the noise, residuals repeat as the motion does, and no sum over one log shows how
much the answer depends on where the steps happened to lie. So the rounding is also played through: the fitted motion,
shifted by a random part of a step, with the noise that the residuals leave room for, is quantized again, and what that
does to the estimates is counted. The larger standard error of the two holds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rds.identification.fit.problem import Problem
from rds.identification.fit.residuals import effective_samples
from rds.identification.fit.solve import Solution
from rds.identification.fit.triangle import triangle_of
from rds.identification.logs.log import Log

_RANK = 1e-7  # of the largest singular value of the scaled derivatives: below it, a direction is not told
_ROUGH_RANK = 1e-5  # where the derivatives are differences
_NOTHING = 1e-9  # of the motion: what a number changes less than, it does not change
_ZERO = 1e-9  # of the units used: what is smaller than any parameter that means something
_PART = 0.05  # of a direction, in numbers scaled by their effect: what takes a smaller part in it is left out
_SHARE = 0.05  # of a log: the longest block
_DRAWS = 40  # of the rounding
_COARSE = 0.6  # encoder steps: noise beyond it makes rounding as good as white


@dataclass(frozen=True)
class Uncertainty:
    """Of the free numbers of a problem: `covariance` (n, n) is infinite where the data tell nothing."""

    covariance: np.ndarray
    without_effect: tuple[int, ...]  # numbers that change nothing
    directions: tuple[np.ndarray, ...]  # (n,) relative changes together that change nothing
    block: int  # samples, the longest of the logs'
    effective: float  # independent samples that the residuals are worth, of all logs
    noise: float  # root mean square of the residuals


def uncertainty_of(problem: Problem, solution: Solution) -> Uncertainty:
    """Covariance of the free numbers at a solution. Draws of the rounding are the same each time."""
    n, point = problem.size, solution.point
    R = solution.triangle[:, :n]
    samples = sum(len(log) for log in problem.logs)
    motion = float(np.sqrt(sum(len(log) * log.position.var() for log in problem.logs))) or 1.0
    scale = np.linalg.norm(R, axis=0)
    # what a number of this size changes; of one that is 0, a whole unit
    empty = scale * np.where(np.abs(point) > _ZERO, np.abs(point), 1.0) <= _NOTHING * motion
    scale[empty] = 1.0
    kept = np.flatnonzero(~empty)
    _, size, right = np.linalg.svd(R[:, kept] / scale[kept])
    told = size > (_RANK if problem.structure.sensitivities else _ROUGH_RANK) * (size[0] if len(size) else 1.0)
    inverse = np.zeros((n, n))
    inverse[np.ix_(kept, kept)] = (right[told].T / size[told] ** 2) @ right[told]
    middle, played, block, effective = np.zeros((n, n)), np.zeros((n, n)), 1, 0.0
    draw = np.random.default_rng(0)
    for number, log in enumerate(problem.logs):
        columns = problem.columns(number)
        error, by = problem.residuals(point, number)
        by = by / scale[columns]
        worth = min(effective_samples(error), len(log))
        length = int(np.clip(np.ceil(4.0 * len(log) / worth), 1, max(1, _SHARE * len(log))))
        place = np.ix_(columns, columns)
        middle[place] += _scores(by * error[:, None], length)
        played[place] += _rounding(log, error, by, draw)
        block, effective = max(block, length), effective + worth
    covariance = inverse @ middle @ inverse * samples / max(samples - len(kept), 1)
    wider = np.sqrt(
        np.divide(
            np.diag(inverse @ played @ inverse), np.diag(covariance), out=np.ones(n), where=np.diag(covariance) > 0.0
        )
    )
    wider = np.maximum(wider, 1.0)
    covariance *= np.outer(wider, wider)
    directions = []
    for row in right[~told]:
        together = np.zeros(n)
        together[kept] = np.where(np.abs(row) > _PART, row / scale[kept], 0.0)
        directions.append(together / np.where(point == 0.0, 1.0, np.abs(point)))
    hidden = empty.copy()
    for row in right[~told]:
        hidden[kept] |= np.abs(row) > 1e-3
    hidden |= np.diag(covariance) < 0.0  # by rounding: too near to such a direction
    covariance /= np.outer(scale, scale)
    covariance[hidden, :] = covariance[:, hidden] = 0.0
    covariance[hidden, hidden] = np.inf
    return Uncertainty(
        covariance=covariance,
        without_effect=tuple(int(i) for i in np.flatnonzero(empty)),
        directions=tuple(directions),
        block=block,
        effective=effective,
        noise=float(np.sqrt(solution.squares / samples)),
    )


def _scores(scores: np.ndarray, length: int) -> np.ndarray:
    """Σ over overlapping blocks of (block's sum)(block's sum)ᵀ / length, blocks at the ends cut short."""
    n = scores.shape[1]
    sums = np.zeros((len(scores) + 2 * length - 1, n))
    np.cumsum(scores, axis=0, out=sums[length : length + len(scores)])
    sums[length + len(scores) :] = sums[length + len(scores) - 1]
    blocks = sums[length:] - sums[:-length]
    R = triangle_of(blocks, np.zeros(len(blocks)))[:, :n]
    return R.T @ R / length


def _rounding(log: Log, error: np.ndarray, by: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    """Covariance of Jᵀ(rounding and noise) over draws of where the encoder's steps lie; 0 where steps do not matter."""
    step = log.resolution or 0.0
    spare = float(error.var()) - step * step / 12.0
    noise = float(np.sqrt(max(spare, 0.0)))
    if step == 0.0 or noise > _COARSE * step:
        return np.zeros((by.shape[1], by.shape[1]))
    motion = log.position - error  # the free run
    moved = []
    for _ in range(_DRAWS):
        true = motion + step * draw.random() + (noise * draw.standard_normal(len(motion)) if noise > 0.0 else 0.0)
        moved.append(by.T @ (np.round(true / step) * step - true))
    if noise > 0.0:  # what is not rounding is white
        R = triangle_of(by, np.zeros(len(by)))[:, :-1]
        return np.cov(np.array(moved).T) + noise**2 * R.T @ R
    return np.cov(np.array(moved).T)
