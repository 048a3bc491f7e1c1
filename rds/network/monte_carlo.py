"""The cost of a loop by events, one after another, with random delays and noise: what `cost` is checked against.

It shares nothing with the Lyapunov equations but the plant over a part of a sample: events wait in a heap, as in
TrueTime, and each path of the noise is drawn.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush
from math import sqrt
from typing import Any

import numpy as np

from rds.network.cost import Law
from rds.network.delays import Delay
from rds.network.sampled import Plant, part

_BATCHES = 50  # for the standard error: means of so many parts of the run
_SETTLING = 0.02  # share of the run that is left out at its beginning


@dataclass(frozen=True)
class Estimate:
    """A mean and its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class Simulated:
    """Mean cost over time, and the variances at the sampling instants."""

    cost: Estimate
    y: Estimate
    u: Estimate


def simulate(
    plant: Plant,
    law: Law,
    h: float,
    delay: Delay,
    *,
    samples: int = 20_000,
    seed: int = 0,
    loss: float = 0.0,
    bins: int = 40,
    every: int = 1,
) -> Simulated:
    """Simulate `samples` of the loop. Delays come from the same histogram of `bins` that `cost` takes."""
    rng = np.random.default_rng(seed)
    values, probabilities = delay.histogram(bins)
    lost = 1.0 - (1.0 - loss) * (1.0 - delay.lost_share)
    drawn = rng.choice(values, samples, p=probabilities)
    drawn[rng.random(samples) < lost] = np.inf
    n = len(plant.A)
    x, z, u, acting_at, held = np.zeros(n), np.zeros(len(law.F)), 0.0, -1, 0.0
    noise = sqrt(plant.noise)
    events: list[tuple[float, int, float]] = []  # when it arrives, when it was sent, V
    parts: dict[float, tuple[Any, ...]] = {}
    costs, ys, us = np.empty(samples), np.empty(samples), np.empty(samples)

    def move(time: float) -> float:
        nonlocal x
        key = round(time, 12)
        if key not in parts:
            over = part(plant, time)
            eigenvalues, vectors = np.linalg.eigh(over.V)
            parts[key] = (over.Phi, over.Gamma[:, 0], vectors * np.sqrt(np.maximum(eigenvalues, 0.0)), over.W, over.w)
        Phi, Gamma, root, W, w = parts[key]
        both = np.append(x, u)
        x = Phi @ x + Gamma * u + root @ rng.standard_normal(n)
        return float(both @ W @ both) + float(w)

    for k in range(samples):
        ys[k] = (plant.C @ x).item() ** 2
        if k % every == 0:
            held = (plant.C @ x).item() + noise * rng.standard_normal()
        command = float((law.H @ z).sum()) + law.D * held
        us[k] = command**2
        z = law.F @ z + law.G[:, 0] * held
        if drawn[k] < np.inf:
            heappush(events, (k * h + drawn[k], k, command))
        now, end, total = k * h, (k + 1) * h, 0.0
        while events and events[0][0] < end - 1e-9 * h:
            at, sent, voltage = heappop(events)
            if sent < acting_at:
                continue
            if at > now + 1e-9 * h:
                total += move(at - now)
                now = at
            acting_at, u = sent, voltage
        total += move(end - now)
        costs[k] = total / h
    first = int(_SETTLING * samples)
    return Simulated(*(_estimate(each[first:]) for each in (costs, ys, us)))


def _estimate(values: np.ndarray) -> Estimate:
    batches = np.array([batch.mean() for batch in np.array_split(values, _BATCHES)])
    return Estimate(float(values.mean()), float(batches.std(ddof=1) / sqrt(_BATCHES)))
