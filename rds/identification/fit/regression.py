"""Linear least squares whose standard errors hold for residuals that are correlated and of uneven size.

θ = (XᵀX)⁻¹ Xᵀ y,      cov θ = (XᵀX)⁻¹ S (XᵀX)⁻¹,      S = Σ_l w_l Σ_k (x_k e_k)(x_{k+l} e_{k+l})ᵀ + transposed

(Newey and West 1987, with Bartlett's weights w_l = 1 - l/(L+1) and the lag L from a first-order autoregression of the
residual, Andrews 1991). Columns are scaled to length one before anything is decided about them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_RANK = 1e-8  # of the largest singular value of the scaled columns: below it a direction is not told
_LONGEST = 0.1  # of the rows: the longest lag


@dataclass(frozen=True)
class Regression:
    """Coefficients in the order of the columns; those in `unidentifiable` have no information and infinite error."""

    values: np.ndarray
    covariance: np.ndarray
    ordinary: np.ndarray  # standard errors if the residual were white and even, (columns,)
    residual: np.ndarray  # y - X θ, of the target's unit
    condition: float  # of the scaled columns
    autocorrelation: float  # of the residual at one row's distance
    lag: int  # rows over which the correlation was counted
    unidentifiable: tuple[int, ...]
    relative_percent: float  # 100 |y - X θ| / |y|


def regress(X: np.ndarray, y: np.ndarray, lengths: Sequence[int]) -> Regression:
    """Coefficients of `y` (rows,) on the columns of `X` (rows, columns); `lengths` are the rows of each log in turn."""
    scale = np.linalg.norm(X, axis=0)
    empty = scale == 0.0
    scaled = X / np.where(empty, 1.0, scale)
    left, size, right = np.linalg.svd(scaled, full_matrices=False)
    told = size > _RANK * size[0]
    theta = right[told].T @ ((left[:, told].T @ y) / size[told])
    residual = y - scaled @ theta
    inverse = (right[told].T / size[told] ** 2) @ right[told]
    correlation, lag = _lag(residual, lengths)
    middle = _spread(scaled * residual[:, None], lengths, lag)
    rows, columns = X.shape
    freedom = max(rows - columns, 1)
    covariance = inverse @ middle @ inverse * rows / freedom
    hidden = empty | (np.abs(right[~told]) > 1e-3).any(axis=0) if not told.all() else empty
    covariance[hidden, :] = covariance[:, hidden] = 0.0
    covariance[hidden, hidden] = np.inf
    back = np.where(empty, 1.0, scale)
    ordinary = np.sqrt(np.diag(inverse) * float(residual @ residual) / freedom) / back
    size_y = float(np.linalg.norm(y))
    return Regression(
        values=np.where(empty, 0.0, theta / back),  # what comes only together has the least that explains as much
        covariance=covariance / np.outer(back, back),
        ordinary=np.where(hidden, np.inf, ordinary),
        residual=residual,
        condition=float(size[0] / size[-1]) if size[-1] > 0.0 else float("inf"),
        autocorrelation=correlation,
        lag=lag,
        unidentifiable=tuple(int(i) for i in np.flatnonzero(hidden)),
        relative_percent=100.0 * float(np.linalg.norm(residual)) / size_y if size_y > 0.0 else float("inf"),
    )


def _blocks(values: np.ndarray, lengths: Sequence[int]) -> list[np.ndarray]:
    return [block for block in np.split(values, np.cumsum(lengths)[:-1]) if len(block) > 1]


def _lag(residual: np.ndarray, lengths: Sequence[int]) -> tuple[float, int]:
    """The residual's correlation at one row's distance, and Andrews' lag for Bartlett's weights."""
    blocks = _blocks(residual, lengths)
    power = sum(float(block @ block) for block in blocks)
    if not power > 0.0:
        return 0.0, 0
    rho = sum(float(block[1:] @ block[:-1]) for block in blocks) / power
    bounded = min(max(rho, -0.97), 0.97)
    alpha = 4.0 * bounded**2 / ((1.0 - bounded) ** 2 * (1.0 + bounded) ** 2)
    longest = int(_LONGEST * min(len(block) for block in blocks))
    return rho, min(int(np.ceil(1.1447 * (alpha * len(residual)) ** (1.0 / 3.0))), max(longest, 1))


def _spread(scores: np.ndarray, lengths: Sequence[int], lag: int) -> np.ndarray:
    total = np.zeros((scores.shape[1], scores.shape[1]))
    for block in _blocks(scores, lengths):
        total += block.T @ block
        for step in range(1, min(lag, len(block) - 1) + 1):
            product = block[step:].T @ block[:-step]
            total += (1.0 - step / (lag + 1.0)) * (product + product.T)
    return total
