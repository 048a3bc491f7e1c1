"""A fit of tau, K, F+ and F- to 10 s at 1 kHz: ours, and the same written plainly.

*Plain* is scipy's `least_squares` over a free run with finite differences, four parameters, position and velocity at
the start, from the same starting values; the free run once the library's axis compiled by numba, once `solve_ivp` with
an event at each zero of the velocity. They must agree with ours within a standard error, and give no intervals.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks.figures import Figure, interleaved, ratios
from rds.identification.fit.estimate import Estimate
from rds.identification.fit.fit import fit
from rds.identification.logs.log import Log
from rds.identification.structures.axis_structure import make
from rds.machines import load_machine
from rds.models.linear_axis import coefficients, respond

NAMES = ("tau", "K", "friction_plus", "friction_minus")
LIMIT = 50.0  # ms
SOLVE_IVP_SECONDS = 1.0  # of the log, for solve_ivp: it takes minutes for all


def run(rounds: int = 7) -> list[Figure]:
    """Everything side by side. RuntimeError if two fits that should agree don't."""
    log = made_log()
    begun = time.perf_counter()
    ours = fit([log], make())
    first_call = 1e3 * (time.perf_counter() - begun)
    simulate = compiled()
    _check("plain", plain_fit(log, simulate), ours)
    runs: dict[str, Callable[[], float]] = {
        "ours": lambda: _milliseconds(lambda: fit([log], make())),
        "plain": lambda: _milliseconds(lambda: plain_fit(log, simulate)),
    }
    times = interleaved(runs, rounds)
    short = log.part(0, round(SOLVE_IVP_SECONDS * 1000))
    short_ours = fit([short], make())
    solver: list[float] = []
    _check("solve_ivp", _timed(lambda: plain_fit(short, by_solve_ivp), solver), short_ours)
    return [
        Figure("rds fit, with intervals, checks and k-step errors", "ms", times["ours"], limit=LIMIT),
        Figure("the same, first call (compiled code from disk, or compiled)", "ms", (first_call,)),
        Figure("least_squares over a numba free run, values only", "ms", times["plain"]),
        Figure("ours / least_squares over numba", "", ratios(times["ours"], times["plain"]), limit=1.0),
        Figure(f"least_squares over solve_ivp, {SOLVE_IVP_SECONDS:g} s of the log", "ms", tuple(solver)),
    ]


def made_log(samples: int = 10_000) -> Log:
    """X of the mini CNC at 1 kHz under a multisine, with 1 µm of noise and the encoder's steps of 1 µm."""
    axis = load_machine("mini-cnc").axes["X"]
    values = {name: float(axis.model[name]) for name in NAMES}
    draw = np.random.default_rng(1)
    t = np.arange(samples) * 0.001
    u = np.sum([np.sin(2.0 * np.pi * 0.7 * k * t + draw.uniform(0.0, 6.28)) for k in range(1, 13)], axis=0)
    u *= 4.0 / np.abs(u).max()
    y = make().respond(t, u, (0.0, 0.0), values) + 0.001 * draw.standard_normal(len(t))
    step = axis.resolution
    return Log("benchmark", t, u, np.round(y / step) * step, resolution=step)


def plain_fit(log: Log, simulate: Callable[..., np.ndarray]) -> np.ndarray:
    """The four parameters (and the initial state) by least squares with finite differences."""
    from scipy.optimize import least_squares

    values, states = next(iter(make().start([log])))  # type: ignore[misc]
    start = np.array([*(values[name] for name in NAMES), *states[0]])
    found = least_squares(
        lambda x: log.position - simulate(log.time, log.command, x),
        start,
        bounds=([1e-4, -np.inf, 0.0, -np.inf, -np.inf, -np.inf], [1.0, np.inf, np.inf, 0.0, np.inf, np.inf]),
        x_scale=np.maximum(np.abs(start), 0.01),
        diff_step=1e-5,
    )
    return found.x[: len(NAMES)]


def compiled() -> Callable[..., np.ndarray]:
    """The library's axis over a log, compiled: (t, u, six numbers) -> positions."""
    from numba import njit

    move = njit(respond)

    @njit
    def loop(u, x, v, constants, y):
        T, decay, reach, tau, K, plus, minus = constants
        for k in range(len(u)):
            y[k] = x
            x, v = move(x, v, u[k], T, decay, reach, tau, K, plus, minus)

    def simulate(t: np.ndarray, u: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        y = np.empty(len(t))
        params = dict(zip(NAMES, numbers.tolist(), strict=False))
        loop(u, numbers[4], numbers[5], coefficients(params, t[1] - t[0]), y)
        return y

    return simulate


def by_solve_ivp(t: np.ndarray, u: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """The same by solve_ivp, sample for sample, stopped where the velocity crosses zero."""
    from scipy.integrate import solve_ivp

    tau, K, plus, minus, x, v = numbers
    y = np.empty(len(t))
    for k in range(len(t)):
        y[k] = x
        if k + 1 == len(t):
            break
        now = t[k]
        for _ in range(3):
            if v == 0.0 and minus <= K * u[k] <= plus:
                break
            friction = plus if v > 0.0 or (v == 0.0 and K * u[k] > plus) else minus

            def slope(_: float, s: np.ndarray, friction: float = friction, drive: float = K * u[k]) -> list[float]:
                return [s[1], (drive - friction - s[1]) / tau]

            def rest(_: float, s: np.ndarray) -> float:
                return s[1]

            rest.terminal = True  # type: ignore[attr-defined]
            rest.direction = -1.0 if friction == plus else 1.0  # type: ignore[attr-defined]
            done = solve_ivp(slope, (now, t[k + 1]), [x, v], events=rest, rtol=1e-8, atol=1e-10)
            x, v, now = done.y[0, -1], done.y[1, -1], done.t[-1]
            if done.status != 1:
                break
            v = 0.0
    return y


def _check(name: str, values: np.ndarray, ours: Estimate) -> None:
    for value, key in zip(values, NAMES, strict=True):
        if abs(value - ours.parameters[key].value) > ours.parameters[key].std_error:
            raise RuntimeError(f"{name}: {key} = {value}, and ours is {ours.parameters[key]}")


def _milliseconds(work: Callable[[], object]) -> float:
    begun = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begun)


def _timed(work: Callable[[], np.ndarray], into: list[float]) -> np.ndarray:
    begun = time.perf_counter()
    values = work()
    into.append(1e3 * (time.perf_counter() - begun))
    return values
