"""The time along the pieces of a planned path with the limit on jerk, by direct collocation, in a process of its own.

    python -m benchmarks.jerk_optimum_peer FILE.npz

reads what `benchmarks.motion` wrote: the floats and whole numbers of the pieces (pieces.py) and the limits of the axes;
and prints JSON: version, seconds. Needs numpy and casadi with IPOPT, not rds. Lines and blends only.

From rest to rest each piece is passed in STEPS of constant jerk along the path, of one duration. Way, speed and
acceleration at their ends, the jerks and the durations are chosen so that the whole takes the least time and each axis
keeps velocity, acceleration and jerk at both ends of each step. What IPOPT finds is a local optimum: a time that can be
reached, and no bound; on long lines the equal steps are too coarse, and cost some thousandths.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import casadi as ca  # type: ignore[import-not-found]
import numpy as np

LENGTH, FEED, SHAPE = 0, 1, 3  # columns of pieces.py
BLENDED, CIRCULAR = 2, 1
STEPS = 32  # of a piece
MOST = 1e3  # mm/s, for rapids
OPTIONS = {"print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.max_iter": 3000, "ipopt.tol": 1e-7}


class _Problem:
    def __init__(self) -> None:
        self.unknown: list[Any] = []
        self.low: list[float] = []
        self.high: list[float] = []
        self.guess: list[float] = []
        self.kept: list[Any] = []
        self.least: list[float] = []
        self.most: list[float] = []

    def var(self, count: int, low: float, high: float, guess: Any) -> Any:
        symbol = ca.MX.sym("x", count)
        self.unknown.append(symbol)
        self.low += [low] * count
        self.high += [high] * count
        self.guess += np.broadcast_to(guess, (count,)).tolist()
        return symbol

    def keep(self, value: Any, within: float = 0.0) -> None:
        self.kept.append(value)
        self.least += [-within] * value.shape[0]
        self.most += [within] * value.shape[0]

    def solve(self, cost: Any) -> float:
        problem = {"x": ca.vertcat(*self.unknown), "f": cost, "g": ca.vertcat(*self.kept)}
        solver = ca.nlpsol("s", "ipopt", problem, OPTIONS)
        found = solver(x0=self.guess, lbx=self.low, ubx=self.high, lbg=self.least, ubg=self.most)
        if not solver.stats()["success"]:
            raise SystemExit(f"IPOPT ended with {solver.stats()['return_status']}")
        return float(found["f"])


def stretch(
    f: np.ndarray, kinds: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, jerk: np.ndarray
) -> float:
    """s, from rest to rest along these pieces."""
    problem, cost, n = _Problem(), 0.0, STEPS
    speed, push = ca.DM(0), ca.DM(0)
    for row, kind in zip(f, kinds, strict=True):
        if kind == CIRCULAR:
            raise SystemExit("an arc is none of the pieces that are known here")
        length, shape, fastest = row[LENGTH], row[SHAPE : SHAPE + 36].reshape(6, 6), min(row[FEED], MOST)
        guess = min(fastest, 3.0 if kind == BLENDED else 8.0)
        lasts = problem.var(1, 1e-7, 10.0, length / guess / n)
        s = problem.var(n + 1, 0.0, length, np.linspace(0.0, length, n + 1))
        v, a = problem.var(n + 1, 0.0, fastest, guess), problem.var(n + 1, -np.inf, np.inf, 0.0)
        j = problem.var(n, -np.inf, np.inf, 0.0)
        for value in (s[0], s[n] - length, v[0] - speed, a[0] - push):
            problem.keep(value)
        problem.keep(s[1:] - (s[:n] + lasts * (v[:n] + lasts * (a[:n] / 2 + lasts * j / 6))))
        problem.keep(v[1:] - (v[:n] + lasts * (a[:n] + lasts * j / 2)))
        problem.keep(a[1:] - (a[:n] + lasts * j))
        for i in np.flatnonzero(np.abs(shape[1:4]).max(axis=0) > 1e-9):
            c1, c2, c3 = shape[1:4, i]
            first, second, third = c1 + s * (2 * c2 + 3 * c3 * s), 2 * c2 + 6 * c3 * s, 6 * c3
            problem.keep(first * v, velocity[i])
            problem.keep(first * a + second * v**2, acceleration[i])
            for part in (slice(0, n), slice(1, n + 1)):
                of_speed = 3 * second[part] * v[part] * a[part] + third * v[part] ** 3
                problem.keep(first[part] * j + of_speed, jerk[i])
        speed, push = v[n], a[n]
        cost = cost + n * lasts
    problem.keep(speed)
    problem.keep(push)
    return problem.solve(cost)


def main() -> None:
    given = np.load(sys.argv[1])
    seconds, first = 0.0, 0
    for end in np.flatnonzero(given["u"][:, 3]) + 1:
        part = slice(first, int(end))
        limits = (given["velocity"], given["acceleration"], given["jerk"])
        seconds += stretch(given["f"][part], given["u"][part, 0], *limits)
        first = int(end)
    print(json.dumps({"version": f"casadi {ca.__version__}", "seconds": seconds}))


if __name__ == "__main__":
    main()
