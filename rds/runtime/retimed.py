"""Planned samples followed at another rate than planned: the feed override and the feed hold.

Between two samples the path is the quintic through their positions, velocities and accelerations; at a rate of r it is
passed with the velocity r v and the acceleration r² a + ṙ v. So no rate leaves the path, and r may change only as fast
as every axis can follow: |r² a + ṙ v| at most its limit. A constant r up to 1 always can; above 1 it stays below the
caps that the planner gives.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rds.runtime.program import Program

FASTEST = 10.0  # 1/s, change of the rate: 100 % of override in 0.1 s at the earliest
SMOOTH = 200.0  # 1/s², change of that
SPARE = 0.97  # of the acceleration that is used: the rest is for what changes between samples


class Retimed:
    """Implements `execution.Follower` for a program; `place` counts samples, and is exact at a rate of 1."""

    def __init__(self, program: Program, T: float):
        self._T = T
        # A memory view gives plain floats, one by one, without a list as large as the program.
        tables = (program.position, program.velocity, program.acceleration, program.caps)
        views: list[Any] = [np.ascontiguousarray(table, dtype=float).reshape(-1).data for table in tables]
        self._p, self._v, self._a, self._caps = views
        self._push = [SPARE * float(limit) for limit in program.limits[1]]
        self._n = len(program.axes)
        self.place, self.rate, self._change = 0.0, 1.0, 0.0
        self.position: list[float] = self._p[: self._n].tolist()
        self.velocity: list[float] = [0.0] * self._n
        self.acceleration: list[float] = [0.0] * self._n

    def advance(self, wanted: float, until: int) -> None:
        """One sample period towards the rate `wanted`, and along the path at most to the sample `until`."""
        before = self.rate
        self.rate = rate = self._next_rate(wanted)
        self._change = (rate - before) / self._T
        self.place = min(self.place + 0.5 * (before + rate), until)
        self._evaluate(rate, self._change)

    def settle(self, wanted: float) -> None:
        """Take the rate `wanted` at once: for a place where the path rests."""
        self.rate, self._change = min(wanted, self._cap(self.place)), 0.0

    def _next_rate(self, wanted: float) -> float:
        place, rate, T = self.place, self.rate, self._T
        i = int(place)
        last = len(self._caps) - 1
        if wanted > 1.0:
            wanted = min(wanted, self._cap(place), self._cap(min(place + rate, last)))
        if rate > 1.0:  # what the caps ahead demand comes before what is smooth
            cap = self._cap(min(place + rate, last))
            if rate >= cap:
                return cap
        off = wanted - rate
        if off == 0.0 and self._change == 0.0:
            return rate
        aim = min(FASTEST, sqrt(2.0 * SMOOTH * abs(off)))
        step = SMOOTH * T
        change = min(max(aim if off > 0.0 else -aim, self._change - step), self._change + step)
        low, high = self._room(i, rate)
        change = min(max(change, low), high)
        new = rate + change * T
        if (off >= 0.0 and new >= wanted) or (off <= 0.0 and new <= wanted):
            return wanted
        if new > 1.0:
            new = min(new, self._cap(min(place + new, last)))
        return max(new, 0.0)

    def _cap(self, place: float) -> float:
        i = int(place)
        here = self._caps[i]
        return here if i == place else here + (self._caps[i + 1] - here) * (place - i)

    def _room(self, i: int, rate: float) -> tuple[float, float]:
        """How fast the rate may fall and rise from the sample `i` on, 1/s.

        Second differences of what is sent see the plan up to two samples further on.
        """
        low, high = -FASTEST, FASTEST
        square = rate * rate
        n = self._n
        for start in range(i * n, min(i + 3, len(self._caps)) * n, n):
            for axis, limit in enumerate(self._push, start):
                v, a = self._v[axis], square * self._a[axis]
                if v < 0.0:
                    v, a = -v, -a
                if v > 0.0:
                    high = min(high, max(limit - a, 0.0) / v)
                    low = max(low, -max(limit + a, 0.0) / v)
        return low, high

    def _evaluate(self, rate: float, change: float) -> None:
        n, T = self._n, self._T
        i = int(self.place)
        q = self.place - i
        start = i * n
        square = rate * rate
        if q == 0.0:
            v, a = self._v[start : start + n].tolist(), self._a[start : start + n].tolist()
            self.position = self._p[start : start + n].tolist()
            if rate == 1.0 and change == 0.0:
                self.velocity, self.acceleration = v, a
                return
        else:
            self.position, v, a = [], [], []
            for axis in range(start, start + n):
                p, dp, ddp = _quintic(
                    self._p[axis],
                    self._v[axis] * T,
                    self._a[axis] * T * T,
                    self._p[axis + n],
                    self._v[axis + n] * T,
                    self._a[axis + n] * T * T,
                    q,
                )
                self.position.append(p)
                v.append(dp / T)
                a.append(ddp / (T * T))
        self.velocity = [rate * value for value in v]
        self.acceleration = [square * push + change * value for push, value in zip(a, v, strict=True)]


def _quintic(p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, q: float) -> tuple[float, float, float]:
    """Value and derivatives at 0 ≤ q ≤ 1 of the quintic with these at its ends."""
    way = p1 - p0
    half = 0.5 * a0
    c3 = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * way - 3.0 * (v0 + v1) - half + 0.5 * a1
    return (
        p0 + q * (v0 + q * (half + q * (c3 + q * (c4 + q * c5)))),
        v0 + q * (a0 + q * (3.0 * c3 + q * (4.0 * c4 + q * 5.0 * c5))),
        a0 + q * (6.0 * c3 + q * (12.0 * c4 + q * 20.0 * c5)),
    )
