"""Fixed-step integration of a differential equation whose input is held.

Our own, because `solve_ivp` chooses its steps, and stalls where friction reverses; equal steps cost and err the
same in every sample, so that a run repeats to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

SUBSTEPS = 10  # steps in each sample, where nothing else is asked for


def rk4(
    derivatives: Callable[..., np.ndarray],
    t: float,
    x: np.ndarray,
    u: np.ndarray,
    T: float,
    params: Any,
    substeps: int = SUBSTEPS,
) -> np.ndarray:
    """The state `T` s after `x` at time `t`, with `u` constant: `substeps` steps of the classical Runge-Kutta method.

    `derivatives(t, x, u, params)` returns an array of the size of `x`. Over a given time the error falls with the
    fourth power of the step.
    """
    h = T / substeps
    for i in range(substeps):
        now = t + i * h
        k1 = derivatives(now, x, u, params)
        k2 = derivatives(now + 0.5 * h, x + 0.5 * h * k1, u, params)
        k3 = derivatives(now + 0.5 * h, x + 0.5 * h * k2, u, params)
        k4 = derivatives(now + h, x + h * k3, u, params)
        x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return x
