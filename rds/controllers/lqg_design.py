"""The numbers of the law `lqg`: gain and covariances by Riccati equations, the axis over whole samples and parts.

scipy solves the Riccati equations; python-control's `dlqe` would give the predictor's gain A M, where a late
measurement needs the filter's, M = P C' / (C P C' + R).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import floor

import numpy as np

from rds.controllers.observer import held_axis
from rds.core.extras import needed_for
from rds.core.integrate import gramian
from rds.core.types import Reference

_ROUNDING = 1e-9  # of a sample
Triple = tuple[float, float, float]  # position, velocity, disturbance
Six = tuple[float, ...]  # a symmetric 3 × 3 matrix: its upper triangle by rows
Held = tuple[float, float, float, float]  # a12, a22, b1, b2 of `held_axis`


@dataclass(frozen=True)
class Design:
    """What the law computes with. The delay is `whole` samples and a fraction, whose motion is `first`."""

    gain: tuple[float, float]  # V/mm, V/(mm/s)
    covariance: Six  # before a measurement, when they come in every sample
    process: Six  # covariance of a sample's noise
    noise: float  # mm², of a measurement
    whole: int
    fraction: float  # samples
    first: Held  # over the fraction
    rest: Held  # over the rest of a sample
    over: Held  # over a sample
    tau: float
    K: float
    delay: float  # s
    limit: float  # V
    integral: bool

    def onward(self, x: Sequence[float], sent: Sequence[float], ago: int) -> Triple:
        """The state one sample on from `ago` samples ago; `sent` are the voltages, the latest first."""
        late = sent[ago + self.whole]
        x = _moved(x, late, self.first) if self.fraction else x
        return _moved(x, sent[ago + self.whole - 1] if ago + self.whole else 0.0, self.rest)

    def ahead(self, x: Sequence[float], sent: Sequence[float]) -> Sequence[float]:
        """The state of now, predicted to the instant from which this sample's voltage acts."""
        for i in range(self.whole):
            x = self.onward(x, sent, -i)
        return _moved(x, sent[0], self.first) if self.fraction else x

    def spread(self, P: Six) -> Six:
        """The covariance a sample later."""
        a12, a22, b1, b2 = self.over
        p00, p01, p02, p11, p12, p22 = P
        q00, q01, q02, q11, q12, q22 = self.process
        r0 = (p00 + a12 * p01 + b1 * p02, p01 + a12 * p11 + b1 * p12, p02 + a12 * p12 + b1 * p22)
        r1 = (a22 * p11 + b2 * p12, a22 * p12 + b2 * p22)
        return (
            r0[0] + a12 * r0[1] + b1 * r0[2] + q00,
            a22 * r0[1] + b2 * r0[2] + q01,
            r0[2] + q02,
            a22 * r1[0] + b2 * r1[1] + q11,
            r1[1] + q12,
            p22 + q22,
        )

    def corrected(self, x: Sequence[float], P: Six, y: float) -> tuple[Triple, Six]:
        """State and covariance with a measured position, mm."""
        p00, p01, p02, p11, p12, p22 = P
        over = 1.0 / (p00 + self.noise)
        m0, m1, m2 = p00 * over, p01 * over, p02 * over
        e = y - x[0]
        return (x[0] + m0 * e, x[1] + m1 * e, x[2] + m2 * e), (
            p00 - m0 * p00,
            p01 - m0 * p01,
            p02 - m0 * p02,
            p11 - m1 * p01,
            p12 - m1 * p02,
            p22 - m2 * p02,
        )

    def voltage(self, x: Sequence[float], r: Reference) -> float:
        """The law without delay at the predicted state; the reference is extrapolated to the same instant."""
        t = self.delay
        position, velocity = r[0] + r[1] * t + 0.5 * r[2] * t * t, r[1] + r[2] * t
        u = self.gain[0] * (position - x[0]) + self.gain[1] * (velocity - x[1])
        u += (velocity + self.tau * r[2]) / self.K - x[2]
        return max(-self.limit, min(self.limit, u))


def designed(tau: float, K: float, T: float, limit: float, options: Mapping[str, float]) -> Design:
    """The design for an axis τ v' + v = K u sampled every `T` s; `options` as in the law."""
    with needed_for("LQG control"):
        from scipy.linalg import solve_discrete_are
    whole = floor(options["delay"] / T + _ROUNDING)
    fraction = max(options["delay"] / T - whole, 0.0)
    fraction = fraction if fraction > _ROUNDING else 0.0
    A, B = np.array([[0.0, 1.0], [0.0, -1.0 / tau]]), np.array([[0.0], [K / tau]])
    cost = np.diag([options["error"] ** -2, 0.0, options["voltage"] ** -2])
    augmented = np.block([[A, B], [np.zeros((1, 3))]])
    weight = gramian(augmented.T, cost, T)  # of [x, u] over a sample, u constant
    a12, a22, b1, b2 = over = held_axis(tau, K, T)
    Phi, Gamma = np.array([[1.0, a12], [0.0, a22]]), np.array([[b1], [b2]])
    Q, S, R = weight[:2, :2], weight[:2, 2:], weight[2:, 2:]
    P = solve_discrete_are(Phi, Gamma, Q, R, s=S)
    gain = np.linalg.solve(R + Gamma.T @ P @ Gamma, Gamma.T @ P @ Phi + S.T)[0]
    has_drift = options["drift"] > 0.0
    intensity = np.zeros((3, 3))
    intensity[:2, :2] = options["disturbance"] ** 2 * B @ B.T
    intensity[2, 2] = options["drift"] ** 2
    process = gramian(augmented, intensity, T)
    n = 3 if has_drift else 2
    step, seen = np.block([[Phi, Gamma], [np.zeros((1, 2)), np.ones((1, 1))]])[:n, :n], np.eye(1, n)
    # so that the equation has a solution without noise; of each state by itself, whose units differ
    jitter = 1e-12 * np.diag(np.maximum(np.diag(process)[:n], 1e-12))
    predicted = np.zeros((3, 3))
    predicted[:n, :n] = solve_discrete_are(
        step.T, seen.T, process[:n, :n] + jitter, np.array([[options["noise"] ** 2]])
    )
    return Design(
        (float(gain[0]), float(gain[1])),
        _six(predicted),
        _six(process),
        options["noise"] ** 2,
        whole,
        fraction,
        held_axis(tau, K, fraction * T),
        held_axis(tau, K, (1.0 - fraction) * T),
        over,
        tau,
        K,
        options["delay"],
        limit,
        has_drift,
    )


def _moved(x: Sequence[float], u: float, over: Held) -> Triple:
    a12, a22, b1, b2 = over
    drive = u + x[2]
    return x[0] + a12 * x[1] + b1 * drive, a22 * x[1] + b2 * drive, x[2]


def _six(P: np.ndarray) -> Six:
    return tuple(float(P[i, j]) for i in range(3) for j in range(i, 3))
