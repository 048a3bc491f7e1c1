"""The cost of a sampled loop under a distribution of its delay, exactly, by Lyapunov equations over the distribution.

The idea is Jitterbug's (B. Lincoln, A. Cervin, CDC 2002): between random events everything is linear, so the covariance
of all states follows from one sample to the next. With ξ = [x, voltage that acts, voltages on their way, law, y held]
and a delay drawn anew in every sample, in each mode m of `late_messages`

    P_m' = Σ over steps m → m' of p (F P_m F' + π_m V)

is a linear equation for all P. Its spectral radius below 1 is stability in the mean square; the cost of a sample is
quadratic in ξ. Delays may be longer than a sample, and messages may be lost (a delay without end). With `every` = n the
sensor is n times slower than the law: y is held for n samples (two rates); the phase is then a part of the mode.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.linear_law import Law
from rds.network.delays import Delay
from rds.network.late_messages import Step, chain, oldest
from rds.network.sampled import Part, Plant, part

__all__ = ["Cost", "Law", "Plant", "cost"]

_DENSE = 600  # unknowns up to which the equation is solved at once
_MOST = 200_000
_ROUNDS = 2000
_ACCURACY = 1e-12


@dataclass(frozen=True)
class Cost:
    """Variances at the sampling instants, the mean cost over time, and the radius (< 1: stable in the mean square).

    An unstable loop has infinite variances and cost.
    """

    cost: float
    y: float  # variance of the plant's output
    u: float  # variance of the law's voltage
    x: np.ndarray  # covariance of the plant's state
    radius: float
    modes: int

    @property
    def stable(self) -> bool:
        """Whether the loop is stable in the mean square."""
        return self.radius < 1.0


def cost(plant: Plant, law: Law, h: float, delay: Delay, *, loss: float = 0.0, bins: int = 40, every: int = 1) -> Cost:
    """The stationary cost of `law` sampled every `h` s, its voltage acting `delay` after the sampling instant.

    `loss` is the share of voltages that is lost (the last one goes on acting). A trace's own losses come on top.
    InputError for delays that are too many samples long to be analysed with so many `bins`.
    """
    values, probabilities = delay.histogram(bins)
    lost = 1.0 - (1.0 - loss) * (1.0 - delay.lost_share)
    delays = [*(values / h).tolist(), inf]
    shares = [*(probabilities * (1.0 - lost)).tolist(), lost]
    modes, steps = chain(_merged(delays), shares)
    loop = _Loop(plant, law, h, oldest(modes), every)
    if (unknowns := len(modes) * every * loop.size**2) > _MOST:
        raise InputError(
            f"delays of up to {oldest(modes)} samples make {unknowns} covariances, and {_MOST} can be solved for; take "
            "fewer bins, or a longer sample period"
        )
    return loop.stationary(len(modes), steps)


def _merged(delays: list[float]) -> list[float]:
    """Delays that are whole samples but for rounding, whole."""
    return [delay if delay == inf or abs(delay - round(delay)) > 1e-9 else float(round(delay)) for delay in delays]


class _Loop:
    """The matrices of each step. ξ = [x (n), acting, on their way with ages 1 to M, z, y held (if two rates)]."""

    def __init__(self, plant: Plant, law: Law, h: float, M: int, every: int):
        self.plant, self.law, self.h, self.M, self.every = plant, law, h, M, every
        self.n, self.m = len(plant.A), len(law.F)
        self.z_at = self.n + 1 + M
        self.size = self.z_at + self.m + (1 if every > 1 else 0)
        self._parts: dict[float, Part] = {}

    def part(self, time: float) -> Part:
        key = round(time, 12)
        if key not in self._parts:
            self._parts[key] = part(self.plant, time * self.h)
        return self._parts[key]

    def step(self, changes: tuple[tuple[float, int], ...], phase: int) -> tuple[np.ndarray, ...]:
        """F and the noise V of ξ over one sample, and its cost ξ' W ξ + w, as (F, V, W, w)."""
        n, m, M, size = self.n, self.m, self.M, self.size
        held_at = size - 1
        eye = np.eye(size)
        measured = np.zeros((1, size))
        is_fresh = phase == 0 or self.every == 1
        if is_fresh:
            measured[:, :n] = self.plant.C
        else:
            measured[0, held_at] = 1.0
        noise = self.plant.noise if is_fresh else 0.0
        u = self.law.D * measured
        u[:, self.z_at : self.z_at + m] += self.law.H
        u_noise = self.law.D  # of the measurement's noise, which every use of y shares
        x, x_noise = eye[:n].copy(), np.zeros((n, 1))
        acting, acting_noise = eye[n : n + 1], 0.0
        V, W, w = np.zeros((n, n)), np.zeros((size, size)), 0.0
        times = [0.0, *(time for time, _ in changes), 1.0]
        ages: list[int | None] = [None, *(age for _, age in changes)]
        for i, age in enumerate(ages):
            if age is not None:
                acting = u if age == 0 else eye[n + age : n + age + 1]
                acting_noise = u_noise if age == 0 else 0.0
            if (time := times[i + 1] - times[i]) <= 0.0:
                continue
            over = self.part(time)
            both = np.vstack([x, acting])
            both_noise = np.vstack([x_noise, [[acting_noise]]])
            W += both.T @ over.W @ both
            w += noise * (both_noise.T @ over.W @ both_noise).item() + over.w + float(np.trace(over.W[:n, :n] @ V))
            x, x_noise = over.Phi @ x + over.Gamma @ acting, over.Phi @ x_noise + over.Gamma * acting_noise
            V = over.Phi @ V @ over.Phi.T + over.V
        F, from_noise = np.zeros((size, size)), np.zeros((size, 1))
        F[:n], from_noise[:n] = x, x_noise
        F[n], from_noise[n] = acting[0], acting_noise
        if M:
            F[n + 1], from_noise[n + 1] = u[0], u_noise
            F[n + 2 : self.z_at] = eye[n + 1 : self.z_at - 1]
        if m:
            rows = slice(self.z_at, self.z_at + m)
            F[rows] = self.law.G @ measured
            F[rows, rows] += self.law.F
            from_noise[rows] = self.law.G
        if self.every > 1:
            F[held_at] = measured[0]
            from_noise[held_at] = 1.0
        noises = noise * from_noise @ from_noise.T
        noises[:n, :n] += V
        return F, noises, W / self.h, np.asarray(w / self.h)

    def stationary(self, modes: int, steps: list[Step]) -> Cost:
        """Solve for the covariances of all modes and phases."""
        all_modes, size = modes * self.every, self.size
        kinds: dict[tuple[tuple[tuple[float, int], ...], int], int] = {}
        made: list[tuple[np.ndarray, ...]] = []
        rows = []
        for phase in range(self.every):
            for step in steps:
                key = (step.changes, phase)
                if key not in kinds:
                    kinds[key] = len(made)
                    made.append(self.step(*key))
                following = modes * ((phase + 1) % self.every)
                rows.append((step.source + modes * phase, step.target + following, step.probability, kinds[key]))
        source, target, kind = (np.array([int(row[i]) for row in rows]) for i in (0, 1, 3))
        p = np.array([row[2] for row in rows])
        F, V, W, w = (np.array(each) for each in zip(*made, strict=True))
        shares = _shares(all_modes, source, target, p)
        F, noise = F[kind], np.zeros((all_modes, size, size))
        np.add.at(noise, target, (p * shares[source])[:, None, None] * V[kind])
        covariances, radius = _solved(F, p, source, target, noise)
        if covariances is None:
            return Cost(inf, inf, inf, np.full((self.n, self.n), inf), radius, all_modes)
        each = p * (np.einsum("kij,kij->k", W[kind], covariances[source]) + shares[source] * w[kind])
        total = covariances.sum(axis=0)
        n = self.n
        y = (self.plant.C @ total[:n, :n] @ self.plant.C.T).item()
        return Cost(float(each.sum()), y, self._voltage(covariances, modes), total[:n, :n], radius, all_modes)

    def _voltage(self, covariances: np.ndarray, modes: int) -> float:
        """Variance of the law's own voltage."""
        total = 0.0
        for phase in range(self.every):
            P = covariances[modes * phase : modes * (phase + 1)].sum(axis=0)
            row = np.zeros(self.size)
            if phase == 0:
                row[: self.n] = self.law.D * self.plant.C[0]
                total += self.law.D**2 * self.plant.noise / self.every
            else:
                row[-1] = self.law.D
            row[self.z_at : self.z_at + self.m] = self.law.H[0]
            total += float(row @ P @ row)
        return total


def _shares(modes: int, source: np.ndarray, target: np.ndarray, p: np.ndarray) -> np.ndarray:
    """How much of the time each mode has: the stationary distribution of the chain."""
    transfer = np.zeros((modes, modes))
    np.add.at(transfer, (target, source), p)
    system = np.vstack([transfer - np.eye(modes), np.ones((1, modes))])
    found = np.linalg.lstsq(system, np.append(np.zeros(modes), 1.0), rcond=None)[0]
    shares: np.ndarray = np.maximum(found, 0.0)
    return shares


def _solved(
    F: np.ndarray, p: np.ndarray, source: np.ndarray, target: np.ndarray, noise: np.ndarray
) -> tuple[np.ndarray | None, float]:
    """The covariances, None where the loop is not stable, and the spectral radius of the equation."""
    modes, size, _ = noise.shape

    def onward(P: np.ndarray) -> np.ndarray:
        moved = np.zeros_like(P)
        np.add.at(moved, target, p[:, None, None] * (F @ P[source] @ F.transpose(0, 2, 1)))
        return moved

    count = modes * size * size
    if len(p) == 1:
        with needed_for("the cost of a loop"):
            from scipy.linalg import solve_discrete_lyapunov
        radius = float(np.abs(np.linalg.eigvals(F[0])).max()) ** 2
        return (solve_discrete_lyapunov(F[0], noise[0])[None] if radius < 1.0 else None), radius
    if count <= _DENSE:
        whole = np.zeros((modes, size * size, modes, size * size))
        for k in range(len(p)):
            whole[target[k], :, source[k], :] += p[k] * np.kron(F[k], F[k])
        system = whole.reshape(count, count)
        radius = float(np.abs(np.linalg.eigvals(system)).max())
        if radius >= 1.0:
            return None, radius
        solved = np.linalg.solve(np.eye(count) - system, noise.reshape(count))
        return solved.reshape(noise.shape), radius
    radius = _radius(onward, noise.shape)
    if radius >= 1.0:
        return None, radius
    with needed_for("the cost of a loop"):
        from scipy.sparse.linalg import LinearOperator, gmres
    operator = LinearOperator(
        (count, count), matvec=lambda v: v - onward(v.reshape(noise.shape)).reshape(count), dtype=float
    )
    solved, failed = gmres(operator, noise.reshape(count), rtol=_ACCURACY, restart=60, maxiter=400)
    if failed:
        raise InputError("the covariances of this loop could not be solved for; take fewer bins")
    return solved.reshape(noise.shape), radius


def _radius(onward: object, shape: tuple[int, ...]) -> float:
    """The spectral radius by powers: the map keeps covariances positive, so that the largest one is real."""
    assert callable(onward)
    P = np.broadcast_to(np.eye(shape[-1]), shape).copy()
    P /= np.linalg.norm(P)
    before = 0.0
    for _ in range(_ROUNDS):
        P = onward(P)
        radius = float(np.linalg.norm(P))
        if radius == 0.0:
            return 0.0
        P /= radius
        if abs(radius - before) <= 1e-10 * radius:
            break
        before = radius
    return radius
