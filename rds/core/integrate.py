"""Fixed-step integration of a differential equation whose input is held; the integral behind costs and covariances.

The steps are our own, because `solve_ivp` chooses its steps, and stalls where friction reverses; equal steps cost and
err the same in every sample, so that a run repeats to the bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil, log2
from typing import Any

import numpy as np

SUBSTEPS = 10  # steps in each sample, where nothing else is asked for
_FEW = 16  # states, for which numbers take less time than arrays


def rk4(
    derivatives: Callable[..., Sequence[float]],
    t: float,
    x: Sequence[float],
    u: Any,
    T: float,
    params: Any,
    substeps: int = SUBSTEPS,
) -> list[float]:
    """The state `T` s after `x` at time `t`, with `u` constant: `substeps` steps of the classical Runge-Kutta method.

    `derivatives(t, x, u, params)` gets the state as numbers, and returns as many, in a sequence of its own. Over a
    given time the error falls with the fourth power of the step.
    """
    h = T / substeps
    half, sixth = 0.5 * h, h / 6.0
    if len(x) > _FEW:
        return _rk4_of_many(derivatives, t, np.array(x), u, params, h, substeps)
    x, each = list(x), range(len(x))
    for i in range(substeps):
        now = t + i * h
        k1 = derivatives(now, x, u, params)
        k2 = derivatives(now + half, [x[n] + half * k1[n] for n in each], u, params)
        k3 = derivatives(now + half, [x[n] + half * k2[n] for n in each], u, params)
        k4 = derivatives(now + h, [x[n] + h * k3[n] for n in each], u, params)
        x = [x[n] + sixth * (k1[n] + 2.0 * (k2[n] + k3[n]) + k4[n]) for n in each]
    return x


def _rk4_of_many(
    derivatives: Callable[..., Sequence[float]], t: float, x: Any, u: Any, params: Any, h: float, substeps: int
) -> list[float]:
    """The same to the bit, with arrays."""
    half, sixth = 0.5 * h, h / 6.0
    for i in range(substeps):
        now = t + i * h
        k1 = np.array(derivatives(now, x, u, params))
        k2 = np.array(derivatives(now + half, x + half * k1, u, params))
        k3 = np.array(derivatives(now + half, x + half * k2, u, params))
        k4 = np.array(derivatives(now + h, x + h * k3, u, params))
        x = x + sixth * (k1 + 2.0 * (k2 + k3) + k4)
    answer: list[float] = x.tolist()
    return answer


def gramian(A: np.ndarray, Q: np.ndarray, time: float) -> np.ndarray:
    """∫ e^(As) Q e^(A's) ds over 0 to `time` s, for a symmetric Q (C. Van Loan, IEEE AC-23 (1978) 395-404).

    His exponential holds e^(-At) too, which drowns the rest where a mode decays within `time`: so it is taken over a
    part in which none does, and doubled.
    """
    from scipy.linalg import expm

    n, doublings = len(A), ceil(log2(max(float(np.linalg.norm(A, 2)) * time, 1.0)))
    big = expm(np.block([[-A, Q], [np.zeros((n, n)), A.T]]) * (time / 2**doublings))
    step = big[n:, n:].T
    found = step @ big[:n, n:]
    for _ in range(doublings):
        found = found + step @ found @ step.T
        step = step @ step
    symmetric: np.ndarray = 0.5 * (found + found.T)
    return symmetric
