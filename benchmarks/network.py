"""A network in a simulation of 10 s, and the cost of a jittered loop: exactly, by Monte Carlo, and by events.

Monte Carlo goes through the samples of many loops at once (numpy), each with delays and noise of its own. The event
simulation (`rds.network.monte_carlo`) takes one loop from event to event, as TrueTime does. Neither is exact, so what
counts is the time that each takes to be good to 1 %, one standard error: it falls with the square root of the samples.
"""

from __future__ import annotations

from math import sqrt
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

import rds
from benchmarks.figures import Figure
from rds.network.cost import Law, cost
from rds.network.delays import Delay
from rds.network.monte_carlo import simulate
from rds.network.sampled import Plant, part

ROUNDS = 9
LIMIT = 2.0  # times the plain simulation
BINS = 20
SAMPLES = 20_000  # of the event simulation
LOOPS, LONG = 1000, 250  # of Monte Carlo: so many loops, so many samples each
_SETTLING = 50  # samples of each
_LINK = {"kind": "uniform", "high": 0.0008, "loss": 0.02}
_PERIOD = 0.002  # s
_AXIS = Plant(
    np.array([[0.0, 1.0], [0.0, -100.0]]), np.array([0.0, 176.0]), np.array([[1.0, 0.0]]), np.diag([0.0, 1.0])
)
_GAIN = -20.0  # V/mm
_DELAY = Delay.named("uniform", low=0.0, high=2.0 * _PERIOD)


class Found(NamedTuple):
    """A mean cost, its standard error, and what it took, ms."""

    cost: float
    error: float
    took: float

    def to_be_good_to(self, share: float) -> float:
        """ms for a standard error of this share of the cost."""
        return self.took * (self.error / self.cost / share) ** 2


def run() -> list[Figure]:
    """Milliseconds of a run, plain and networked, in turn; and of the cost by each method, with its error."""
    options: dict[str, Any] = {"axis": "X", "reference": rds.sinusoid(5.0, 0.2), "controller": {"name": "tracking"}}
    plain = rds.Experiment(**options)
    networked = rds.Experiment(**options, network={"sensor": _LINK, "actuator": _LINK})
    times: dict[str, list[float]] = {"plain": [], "networked": []}
    for _ in range(ROUNDS + 1):
        for name, experiment in (("plain", plain), ("networked", networked)):
            begun = perf_counter()
            experiment.run()
            times[name].append(1e3 * (perf_counter() - begun))
    ratios = tuple(b / a for a, b in zip(times["plain"][1:], times["networked"][1:], strict=True))
    exact_times, loops, events = [], [], []
    for number in range(3):
        begun = perf_counter()
        exact = cost(_AXIS, Law.gain(_GAIN), _PERIOD, _DELAY, bins=BINS)
        exact_times.append(1e3 * (perf_counter() - begun))
        loops.append(_many_loops(number))
        events.append(_by_events(number))
    return [
        Figure("10 s at 1 kHz, plain", "ms", tuple(times["plain"][1:])),
        Figure("with random delay and loss both ways", "ms", tuple(times["networked"][1:])),
        Figure("of the plain one", "times", ratios, LIMIT),
        Figure("cost with delays up to two samples, by Lyapunov equations", "ms", tuple(exact_times)),
        *_of(f"by Monte Carlo, {LOOPS} loops of {LONG} samples", loops, exact.cost),
        *_of(f"by events as in TrueTime, {SAMPLES:,} samples", events, exact.cost),
    ]


def _of(name: str, found: list[Found], exact: float) -> list[Figure]:
    return [
        Figure(name, "ms", tuple(each.took for each in found)),
        Figure(f"{name}: off the exact cost", "%", tuple(100.0 * abs(each.cost / exact - 1.0) for each in found)),
        Figure(f"{name}: its standard error", "%", tuple(100.0 * each.error / each.cost for each in found)),
        Figure(f"{name}: to be good to 1 %", "ms", tuple(each.to_be_good_to(0.01) for each in found)),
    ]


def _by_events(seed: int) -> Found:
    begun = perf_counter()
    found = simulate(_AXIS, Law.gain(_GAIN), _PERIOD, _DELAY, bins=BINS, samples=SAMPLES, seed=seed).cost
    return Found(found.value, found.error, 1e3 * (perf_counter() - begun))


def _many_loops(seed: int) -> Found:
    """Samples in which at most two voltages begin to act: the one before's, if it is late, and this one's."""
    begun = perf_counter()
    rng = np.random.default_rng(seed)
    values, shares = _DELAY.histogram(BINS)
    delays = np.round(values / _PERIOD, 9)  # samples, below 2
    starts = np.unique(np.append(np.mod(delays, 1.0), [0.0, 1.0]))
    times = np.unique(np.round(np.abs(starts[:, None] - starts), 9))
    parts = [part(_AXIS, float(time) * _PERIOD) for time in times]
    Phi, Gamma, W = (np.array([getattr(each, name) for each in parts]) for name in ("Phi", "Gamma", "W"))
    w = np.array([each.w for each in parts])
    roots = np.array([_root(each.V) for each in parts])
    n = len(_AXIS.A)
    x, acting, before, late = np.zeros((LOOPS, n)), np.zeros(LOOPS), np.zeros(LOOPS), np.full(LOOPS, np.inf)
    total = np.zeros(LOOPS)
    for k in range(_SETTLING + LONG):
        own = rng.choice(delays, LOOPS, p=shares)
        u = _GAIN * (x @ _AXIS.C[0])
        first = np.where((late < 1.0) & (late <= own), late, np.minimum(own, 1.0))  # else it is overtaken
        second = np.minimum(own, 1.0)
        spans = ((0.0, first, acting), (first, second, before), (second, 1.0, u))
        for since, until, voltage in spans:
            at = np.searchsorted(times, np.round(until - since, 9) - 1e-10)
            both = np.column_stack([x, voltage])
            if k >= _SETTLING:
                total += np.einsum("ki,kij,kj->k", both, W[at], both) + w[at]
            x = np.einsum("kij,kj->ki", Phi[at], x) + Gamma[at, :, 0] * voltage[:, None]
            x += np.einsum("kij,kj->ki", roots[at], rng.standard_normal((LOOPS, n)))
        acting = np.where(own < 1.0, u, np.where(late < 1.0, before, acting))
        before, late = u, np.where(own < 1.0, np.inf, own - 1.0)
    costs = total / (LONG * _PERIOD)
    took = 1e3 * (perf_counter() - begun)
    return Found(float(costs.mean()), float(costs.std(ddof=1) / sqrt(LOOPS)), took)


def _root(V: np.ndarray) -> np.ndarray:
    """A matrix whose square is the covariance `V`."""
    eigenvalues, vectors = np.linalg.eigh(V)
    found: np.ndarray = vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    return found
