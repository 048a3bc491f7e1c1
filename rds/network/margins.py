"""How much delay, and how much jitter, a sampled loop bears.

The delay margin is the least constant delay at which the loop is no longer stable, of all at which that happens: the
sampled loop has its poles computed exactly, voltages on their way included.

The jitter margin J(L) is that of C.-Y. Kao and B. Lincoln (Automatica 40 (2004) 1429-1434): with a constant delay L and
any further delay that changes from sample to sample between 0 and J, the loop is stable if for all ω from 0 to π

    |P_alias K / (1 + P_ZOH K)| < 1 / (Ñ |e^(iω) - 1|),        Ñ² = ⌊N⌋² + 2 ⌊N⌋ g + g,   N = J/h,   g = N - ⌊N⌋

where P_ZOH is the plant with L sampled with a hold, and P_alias(ω)² = Σ over k of |P(i (ω + 2 π k)/h)|². It is
sufficient, whatever the jitter's distribution.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf

import numpy as np

from rds.network.cost import Law
from rds.network.sampled import Plant, response

_PER_SAMPLE = 16  # constant delays that are looked at in each sample
_LONGEST = 60  # samples of delay
_ALIASES = 30
_GRID = 800


@dataclass(frozen=True)
class Margins:
    """Delay margin (s; infinite: none up to 60 samples), and for constant delays L (s) the jitter margin J(L) (s)."""

    delay: float
    L: np.ndarray
    J: np.ndarray

    def jitter(self, L: float) -> float:
        """The jitter margin at a constant delay, s; 0 where the loop is not stable."""
        return float(np.interp(L, self.L, self.J, right=0.0))

    def bears(self, least: float, most: float) -> bool:
        """Whether delays that change between `least` and `most` (s) surely leave the loop stable."""
        return most - least < self.jitter(least)


def margins(plant: Plant, law: Law, h: float, points: int = 40) -> Margins:
    """The margins of a loop that is sampled every `h` s, the voltage acting at the sampling instant plus the delay."""
    delay = delay_margin(plant, law, h)
    L = np.linspace(0.0, min(delay, _LONGEST * h), points)
    J = np.array([0.0 if each >= delay else jitter_margin(plant, law, h, float(each)) for each in L])
    return Margins(delay, L, J)


def delay_margin(plant: Plant, law: Law, h: float) -> float:
    """The least constant delay (s) at which the loop is not stable; 0: it is not without one; inf: there is none."""
    if radius(plant, law, h, 0.0) >= 1.0:
        return 0.0
    before = 0.0
    for number in range(1, _LONGEST * _PER_SAMPLE + 1):
        at = number * h / _PER_SAMPLE
        if radius(plant, law, h, at) >= 1.0:
            low, high = before, at
            for _ in range(50):
                middle = 0.5 * (low + high)
                low, high = (low, middle) if radius(plant, law, h, middle) >= 1.0 else (middle, high)
            return high
        before = at
    return inf


def radius(plant: Plant, law: Law, h: float, delay: float) -> float:
    """The largest modulus of the closed loop's poles with a constant delay, s."""
    Phi, Gammas = _held(plant, h, delay)
    n, m, M = len(Phi), len(law.F), len(Gammas) - 1
    whole = np.zeros((n + M + m, n + M + m))
    u = np.zeros((1, n + M + m))
    u[:, :n], u[:, n + M :] = law.D * plant.C, law.H
    whole[:n, :n] = Phi
    for age in range(1, M + 1):
        whole[:n, n + age - 1] = Gammas[age]
    whole[:n] += Gammas[0][:, None] * u
    if M:
        whole[n : n + 1] = u
        whole[n + 1 : n + M, n : n + M - 1] = np.eye(M - 1)
    whole[n + M :, :n], whole[n + M :, n + M :] = law.G @ plant.C, law.F
    return float(np.abs(np.linalg.eigvals(whole)).max())


def jitter_margin(plant: Plant, law: Law, h: float, L: float) -> float:
    """J(L), s; the loop with the constant delay `L` must be stable."""
    w = np.geomspace(1e-5, np.pi, _GRID)
    z = np.exp(1j * w)
    Phi, Gammas = _held(plant, h, L)
    inputs = sum(np.multiply.outer(z**-age, Gamma) for age, Gamma in enumerate(Gammas))
    P = _answer(Phi, inputs, plant.C, z)
    K = -(_answer(law.F, np.broadcast_to(law.G[:, 0], (len(z), len(law.F))), law.H, z) + law.D)
    k = np.arange(-_ALIASES, _ALIASES + 1)
    s = (1j * (w[:, None] + 2.0 * np.pi * k) / h).ravel()
    continuous = _answer(plant.A, np.broadcast_to(plant.B.reshape(-1), (len(s), len(plant.A))), plant.C, s)
    alias = np.sqrt((np.abs(continuous.reshape(len(w), -1)) ** 2).sum(axis=1))
    gain = np.abs(alias * K / (1.0 + P * K)) * np.abs(z - 1.0)
    return _jitter_of(1.0 / float(gain.max())) * h


def _answer(A: np.ndarray, B: np.ndarray, C: np.ndarray, s: np.ndarray) -> np.ndarray:
    """C (s - A)⁻¹ B for each s, with a B for each."""
    inverted = np.linalg.solve(s[:, None, None] * np.eye(len(A)) - A, B[:, :, None].astype(complex))
    found: np.ndarray = (C @ inverted)[:, 0, 0]
    return found


def _jitter_of(allowed: float) -> float:
    """N for which Ñ reaches what is allowed, samples."""
    N = float(floor(allowed))
    # between whole numbers Ñ² = ⌊N⌋² + (2 ⌊N⌋ + 1) g
    return N + (allowed**2 - N**2) / (2.0 * N + 1.0)


def _held(plant: Plant, h: float, delay: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Φ over a sample, and Γ of the voltages of ages 0, 1, ... samples."""
    whole = floor(delay / h + 1e-9)
    fraction = max(delay - whole * h, 0.0)
    fraction = fraction if fraction > 1e-9 * h else 0.0
    rest, acting = response(plant, h - fraction)
    Gammas = [np.zeros(len(rest)) for _ in range(whole)] + [acting]
    if not fraction:
        return rest, Gammas
    first, before = response(plant, fraction)
    return rest @ first, [*Gammas, rest @ before]
