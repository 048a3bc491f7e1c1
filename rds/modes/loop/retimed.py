"""Planned samples followed at another rate than planned: the feed override and the feed hold.

Between two samples the path is the quintic through their positions, velocities and accelerations; at a rate of r it is
passed with the velocity r v, the acceleration r² a + ṙ v and the jerk r³ j + 3 r ṙ a + r̈ v. So no rate leaves the path,
and a constant r of at most FREE keeps every limit that the plan keeps: where the plan changes its jerk between two
samples, the quintics have up to 0.88 % more of it. A ramp to 1 ends at a sample of the plan, and from there on the
planned samples are sent. A change of the rate is a `Ramp`; before it begins, each of its samples is worked out and held
against velocity, acceleration and jerk of every axis. Another rate above FREE is taken only with a way back to 1 that
is known to keep the limits as well, and left where that way would no longer do so.
"""

from __future__ import annotations

from math import ceil
from typing import Any

import numpy as np

from rds.modes.loop.program import Program
from rds.modes.loop.ramp import (
    EXTRA_SHARPEST,
    EXTRA_STEEPEST,
    FURTHEST,
    SHARPEST,
    SHORTEST,
    STEEPEST,
    Ramp,
    VariableRate,
    in_steps,
)

FREE = 0.997  # up to this rate no limit that the plan keeps can be exceeded
EXCESS = 0.001  # by which differences of the samples sent may exceed a limit, relative: quintics are no plan
PATIENCE = 0.5  # s after which somebody who wants it slower gets the gentlest step, wherever the path is
_STAY = 8  # samples at a rate above FREE that are checked at once
_LANDS_WITH = 0.25  # of what acceleration and jerk allow, for ending at a sample of the plan
_AHEAD = 0.2  # s of the plan whose speed says how long a ramp will have to be
# Ramps that are tried, one at each sample: share of the change that is wanted, times as long as the least.
_TRIES = ((1.0, 1.05), (1.0, 1.5), (1.0, 2.2), (1.0, 3.5), (0.3, 1.5), (0.3, 3.5), (0.05, 2.0), (0.05, 5.0))


class RetimedProgram(VariableRate):
    """Implements `execution.Follower` for a program; `place` counts samples, and is exact at a rate of 1."""

    def __init__(self, program: Program, T: float):
        super().__init__()
        self._T = T
        self._tables = tuple(
            np.ascontiguousarray(table, dtype=float)
            for table in (program.position, program.velocity, program.acceleration)
        )
        # A memory view gives plain floats, one by one, without a list as large as the program.
        views: list[Any] = [table.reshape(-1).data for table in self._tables]
        self._p, self._v, self._a = views
        self._n = len(program.axes)
        self.happenings, self.last, self._line = program.happenings, program.samples - 1, program.line
        self._limits = np.asarray(program.limits, dtype=float)
        self.position: list[float] = self._p[: self._n].tolist()
        self.velocity: list[float] = [0.0] * self._n
        self.acceleration: list[float] = [0.0] * self._n
        self._past = [self.position] * 3  # the last samples, for differences
        self._back = Ramp(1.0, 1.0, 1)  # from a rate above FREE, known to keep the limits
        self._tries = self._sure = 0
        self._rests = True

    def line(self, sample: int) -> int:
        """The program line of a sample."""
        return int(self._line[sample])

    def columns(self) -> tuple[float, ...]:
        """Nothing else is recorded of it."""
        return ()

    def advance(self, wanted: float, until: int) -> None:
        """One sample period towards the rate `wanted`, and along the path at most to the sample `until`."""
        if self._ramp is None and (wanted != self.rate or _is_watched(self.rate)):
            self._choose(wanted, until)
        place, slope = self._next_place()
        self._rests = self._rests and self.rate == 0.0
        self.place = min(place, until)
        self._evaluate(self.rate, slope / self._T)
        self._past = [*self._past[1:], self.position]
        if place >= until:
            self.settle(wanted)

    def settle(self, wanted: float) -> None:
        """Take the rate `wanted`, or 1 where it would have to be watched, at once: for a place where the path rests."""
        self.rate, self._ramp, self._rests = wanted if wanted <= FREE else 1.0, None, True
        self._past = [self.position] * 3
        self._tries = self._sure = 0

    def _choose(self, wanted: float, until: int) -> None:
        """Begin a ramp, if one keeps the limits from here on."""
        rate = self.rate
        if self._rests:
            self.settle(wanted)
            return
        self._sure -= 1
        if _is_watched(rate) and self._sure < 0:
            if self._share([Ramp(rate, rate, _STAY), self._back], until) > 1.0 + EXCESS:
                self._begin(self._back)
                return
            self._sure = _STAY - 1
        elif wanted != rate:
            self._try(wanted, until)

    def _try(self, wanted: float, until: int) -> None:
        """Begin one of the ramps towards `wanted`, if it keeps the limits; the next sample tries another one."""
        ramp = self._towards(wanted, *_TRIES[self._tries % len(_TRIES)])
        self._tries += 1
        back = Ramp(ramp.end, 1.0, ramp.samples)
        if self._share([ramp, back] if _is_watched(ramp.end) else [ramp], until) <= 1.0 + EXCESS:
            self._begin(ramp)
            self._back = back
        elif wanted < self.rate <= 1.0 and self._tries * self._T > PATIENCE:
            self._begin(self._towards(wanted, *_TRIES[-1]))

    def _begin(self, ramp: Ramp) -> None:
        self._go_along(ramp)
        self._tries = self._sure = 0

    def _towards(self, wanted: float, share: float, longer: float) -> Ramp:
        """A ramp from the rate now by a share of what is wanted, `longer` times as long as the speed here asks for."""
        i, T, rate = int(self.place), self._T, self.rate
        v = np.abs(self._tables[1][i : i + 1 + ceil(_AHEAD / T)]).max(axis=0)
        _, acceleration, jerk = self._limits
        landing = max(
            float(np.sqrt(EXTRA_STEEPEST * FURTHEST / _LANDS_WITH * T * v / acceleration).max()),
            float(np.cbrt(EXTRA_SHARPEST * FURTHEST / _LANDS_WITH * T * v / jerk).max()),
        )

        def seconds(size: float) -> float:
            speed = v * size
            least = max(SHORTEST, (STEEPEST * speed / acceleration).max(), np.sqrt(SHARPEST * speed / jerk).max())
            return longer * float(least)

        change, samples = in_steps(share * (wanted - rate), seconds, T)
        return Ramp(rate, wanted if change == wanted - rate else rate + change, max(samples, ceil(landing / T)))

    def _share(self, ramps: list[Ramp], until: int) -> float:
        """The largest share of a limit that the samples of these ramps, one after the other, take of any axis."""
        parts, place = [], self.place
        for planned in ramps:
            ramp = planned.beginning_at(place)
            parts.append(place + ramp.passed(np.arange(1.0, ramp.samples + 1.0)))
            place = float(parts[-1][-1])
        parts.append(place + ramps[-1].end * np.array((1.0, 2.0, 3.0)))  # and on at that rate
        places = np.minimum(np.concatenate(parts), until)
        i = np.minimum(places.astype(int), max(until - 1, 0))
        q = (places - i)[:, None]
        p, v, a = self._tables
        T = self._T
        there = min(1, len(p) - 1)
        ends = (p[i], v[i] * T, a[i] * (T * T), p[i + there], v[i + there] * T, a[i + there] * (T * T))
        samples = np.concatenate((self._past, _quintic(*ends, q)[0]))
        worst = 0.0
        for order, limit in enumerate(self._limits, 1):
            change = np.abs(np.diff(samples, order, axis=0)[3 - order :])
            worst = max(worst, float((change.max(axis=0) / (limit * T**order)).max()))
        return worst

    def _evaluate(self, rate: float, slope: float) -> None:
        n, T = self._n, self._T
        i = int(self.place)
        q = self.place - i
        start = i * n
        square = rate * rate
        if q == 0.0:
            v, a = self._v[start : start + n].tolist(), self._a[start : start + n].tolist()
            self.position = self._p[start : start + n].tolist()
            if rate == 1.0 and slope == 0.0:
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
        self.acceleration = [square * push + slope * value for push, value in zip(a, v, strict=True)]


def _is_watched(rate: float) -> bool:
    """Whether the limits could be exceeded at this rate: not where the planned samples are sent."""
    return rate > FREE and rate != 1.0


def _quintic(p0: Any, v0: Any, a0: Any, p1: Any, v1: Any, a1: Any, q: Any) -> tuple[Any, Any, Any]:
    """Value and derivatives at 0 ≤ q ≤ 1 of the quintic with these at its ends; numbers or arrays."""
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
