"""Linear plants over a part of a sample, exactly: response, noise and cost (C. Van Loan, IEEE AC-23 (1978) 395-404).

dx = (A x + B u) dt + dv        v a Wiener process of intensity R
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rds.core.extras import needed_for
from rds.core.integrate import gramian


@dataclass(frozen=True)
class Plant:
    """A linear plant with one input, its noise of intensity `R` (n × n) and the output `C` (1 × n) that is measured.

    `noise` is the variance of the measurement noise. The cost is the mean of (`Q_y` y² + `Q_u` u²) over time.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    R: np.ndarray
    noise: float = 0.0
    Q_y: float = 1.0
    Q_u: float = 0.0

    @property
    def Q(self) -> np.ndarray:
        """Weight of [x, u], (n + 1) × (n + 1)."""
        n = len(self.A)
        made = np.zeros((n + 1, n + 1))
        made[:n, :n] = self.Q_y * self.C.T @ self.C
        made[n, n] = self.Q_u
        return made


@dataclass(frozen=True)
class Part:
    """The plant over some time of constant u: x⁺ = Φ x + Γ u + v, E[v v'] = V; [x, u]' W [x, u] + w is its cost."""

    Phi: np.ndarray
    Gamma: np.ndarray
    V: np.ndarray
    W: np.ndarray
    w: float


def part(plant: Plant, time: float) -> Part:
    """The plant over `time` s."""
    with needed_for("the cost of a loop"):
        from scipy.linalg import expm
    n = len(plant.A)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n:] = plant.A, plant.B.reshape(n, 1)
    step = expm(whole * time)
    Phi, Gamma = step[:n, :n], step[:n, n:]
    V = gramian(plant.A, plant.R, time)
    W = gramian(whole.T, plant.Q, time)
    # the noise that comes in at s costs tr(Q ∫₀^(t-s) e^(Ar) R e^(A'r) dr): the integral of its own gramian
    return Part(Phi, Gamma, V, W, _noise_cost(plant, time))


def response(plant: Plant, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Φ (n × n) and Γ (n) of `part` alone."""
    with needed_for("the analysis of a loop"):
        from scipy.linalg import expm
    n = len(plant.A)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = plant.A, plant.B.reshape(n)
    step = expm(whole * time)
    return step[:n, :n], step[:n, n]


def _noise_cost(plant: Plant, time: float) -> float:
    """∫ tr(Q_x V(s)) ds over 0 to `time`, V(s) the covariance that the noise has made by s."""
    from scipy.linalg import expm

    n = len(plant.A)
    Qx = plant.Q[:n, :n]
    # d/ds vec V = (A ⊕ A) vec V + vec R, and the cost is one more state
    lift = np.zeros((n * n + 2, n * n + 2))
    lift[: n * n, : n * n] = np.kron(plant.A, np.eye(n)) + np.kron(np.eye(n), plant.A)
    lift[: n * n, n * n] = plant.R.reshape(-1)
    lift[n * n + 1, : n * n] = Qx.reshape(-1)
    return float(expm(lift * time)[n * n + 1, n * n])
