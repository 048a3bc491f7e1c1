"""A network in a simulation of 10 s, and the exact cost of a jittered loop beside Monte Carlo."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

import rds
from benchmarks.figures import Figure
from rds.network.cost import Law, cost
from rds.network.delays import Delay
from rds.network.monte_carlo import simulate
from rds.network.sampled import Plant

ROUNDS = 9
LIMIT = 2.0  # times the plain simulation
SAMPLES = 20_000
_LINK = {"kind": "uniform", "high": 0.0008, "loss": 0.02}


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
    axis = Plant(
        np.array([[0.0, 1.0], [0.0, -100.0]]), np.array([0.0, 176.0]), np.array([[1.0, 0.0]]), np.diag([0.0, 1.0])
    )
    law, delay = Law.gain(-20.0), Delay.named("uniform", low=0.0, high=0.004)
    exact_times, drawn_times = [], []
    for _ in range(3):
        begun = perf_counter()
        exact = cost(axis, law, 0.002, delay, bins=20)
        exact_times.append(1e3 * (perf_counter() - begun))
    begun = perf_counter()
    drawn = simulate(axis, law, 0.002, delay, bins=20, samples=SAMPLES)
    drawn_times.append(1e3 * (perf_counter() - begun))
    return [
        Figure("10 s at 1 kHz, plain", "ms", tuple(times["plain"][1:])),
        Figure("with random delay and loss both ways", "ms", tuple(times["networked"][1:])),
        Figure("of the plain one", "times", ratios, LIMIT),
        Figure("cost with delays up to two samples, by Lyapunov equations", "ms", tuple(exact_times)),
        Figure(f"the same by an event simulation of {SAMPLES:,} samples", "ms", tuple(drawn_times)),
        Figure("its standard error", "%", (100.0 * drawn.cost.error / drawn.cost.value,)),
        Figure("its difference from the exact cost", "%", (100.0 * abs(drawn.cost.value / exact.cost - 1.0),)),
    ]
