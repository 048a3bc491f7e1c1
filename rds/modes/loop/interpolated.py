"""Samples that an interpolator makes while they are carried out: the feed override and the feed hold on them.

At a rate of 1 each row of the interpolator is sent as it is, and one more is made at each sample. At another rate the
path between two rows is the cubic through their positions and velocities, with no slope steeper than three times the
straight line's, so that it never turns back between them. What comes is not known, so the rate changes only as fast as
the largest feed of the path would allow with a share of each axis's acceleration and jerk; for the same reason it is
never above 1. A ramp to 1 ends at a row, and from there on the rows are sent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import repeat
from math import ceil

import numpy as np

from rds.core.errors import ContractError
from rds.modes.loop.program import Happening, InterpolatedProgram, Row, dwell_samples
from rds.modes.loop.ramp import (
    EXTRA_SHARPEST,
    EXTRA_STEEPEST,
    FURTHEST,
    SHARPEST,
    SHORTEST,
    STEEPEST,
    Paced,
    Ramp,
    in_steps,
)

LEAST_AHEAD = 3  # rows: a ramp that ends at a row may pass more than one of them in a sample
_SHARE = 0.5  # of an axis's acceleration and jerk for a change of the rate; the path's own motion has the rest
_LANDS_WITH = 0.25  # of them for ending at a row
_FASTEST = 1.5  # times an axis's velocity that a row may ask for: the drive would follow, and nobody meant it
_ROUNDED = 0.02  # mm or degrees that rounding to BLU may add to a row
_BEYOND = 1e-6  # mm that the last digits of a path may lie beyond the travel
_ROTARY = "ABC"
_UNKNOWN = 1 << 50  # samples: the end is not in sight


class Interpolated(Paced):
    """Implements `execution.Follower` for rows that are made on the way; `place` counts rows.

    ContractError for a row that no axis could go to: out of its travel, or much faster than it moves.
    """

    def __init__(self, program: InterpolatedProgram, T: float):
        super().__init__()
        self._program, self._T = program, T
        self._lines = program.line
        velocity, acceleration, jerk = np.asarray(program.limits, dtype=float)
        self._velocity = velocity.tolist()
        self._longest = (_FASTEST * velocity * T + _ROUNDED).tolist()
        self._travel = [(low - _BEYOND, high + _BEYOND) for low, high in program.travel.tolist()]
        # s and s² that a change of the rate by 1 takes at the largest feed, of the weakest axis
        slow, sharp = program.feed / float(acceleration.min()), program.feed / float(jerk.min())
        self._slow, self._sharp = STEEPEST * slow / _SHARE, SHARPEST * sharp / _SHARE
        landing = (EXTRA_STEEPEST * slow * FURTHEST * T / _LANDS_WITH) ** 0.5
        self._landing = ceil(max(landing, (EXTRA_SHARPEST * sharp * FURTHEST * T / _LANDS_WITH) ** (1.0 / 3.0)) / T)
        zero = [0.0] * len(program.axes)
        self._rows: deque[Row] = deque([(list(program.start), zero, zero, 0)])
        self._first = 0  # the number of the first row that is kept
        self.happenings: list[Happening] = []
        self.last = _UNKNOWN
        self._left = iter(program.stretches)
        self._stretch: Iterator[Row] | None = None
        self._due: tuple[Happening, ...] = program.first
        self._rests()
        self.position: list[float] = list(program.start)
        self.velocity, self.acceleration = zero, zero
        self._fill()

    def line(self, sample: int) -> int:
        """The program line of a sample that is kept."""
        return self._lines[self._row(sample)[3]]

    def columns(self) -> tuple[float, ...]:
        """The segment (from 1), and how many rows are made beyond where it is."""
        at = -int(-self.place // 1)
        return self._row(at)[3] + 1, self._first + len(self._rows) - 1 - at

    def advance(self, wanted: float, until: int) -> None:
        """One sample period towards the rate `wanted`, and along the path at most to the sample `until`."""
        if self._ramp is None and wanted != self.rate:
            self._begin(min(wanted, 1.0))
        place, slope = self._next_place()
        self.place = min(place, until)
        self._fill()
        self._evaluate(slope / self._T)
        if place >= until:
            self.settle(wanted)

    def settle(self, wanted: float) -> None:
        """Take the rate `wanted` at once: for a place where the path rests."""
        self.rate, self._ramp = min(wanted, 1.0), None
        self._fill()

    # --- the rate -------------------------------------------------------------------------------------------------

    def _begin(self, wanted: float) -> None:
        """Begin a ramp from the rate now towards `wanted`, as long as the weakest axis needs."""
        change, samples = in_steps(
            wanted - self.rate, lambda size: max(SHORTEST, self._slow * size, (self._sharp * size) ** 0.5), self._T
        )
        end = wanted if change == wanted - self.rate else self.rate + change
        self._go_along(Ramp(self.rate, end, max(samples, self._landing) if end == 1.0 else samples))

    # --- the rows -------------------------------------------------------------------------------------------------

    def _row(self, sample: int) -> Row:
        return self._rows[min(max(sample - self._first, 0), len(self._rows) - 1)]

    def _fill(self) -> None:
        """Let the interpolator make rows until there are enough beyond where it is; forget those that are passed."""
        rows, at = self._rows, int(self.place)
        while self._first < at and len(rows) > 1:
            rows.popleft()
            self._first += 1
        while self._first + len(rows) - 1 < at + self._program.ahead and self.last == _UNKNOWN:
            self._make()

    def _make(self) -> None:
        """One more row; or the end of a stretch, which is a place of rest."""
        if self._stretch is None:
            stretch = next(self._left, None)
            if stretch is None:
                self.last = self._first + len(self._rows) - 1
                return
            self._stretch, self._due = stretch.rows(), stretch.happenings
        row = next(self._stretch, None)
        if row is None:
            self._stretch = None
            self._rests()
        else:
            self._check(row)
            self._rows.append(row)

    def _rests(self) -> None:
        """What is due where the rows have come to; a dwell has rows of its own."""
        position, _, _, segment = self._rows[-1]
        sample = self._first + len(self._rows) - 1
        zero = [0.0] * len(position)
        for happening in self._due:
            self.happenings.append(happening._replace(sample=sample))
            if happening.kind == "dwell":
                count = dwell_samples(happening.value, self._T)
                self._rows.extend(repeat((position, zero, zero, segment), count))
                sample += count
        self._due = ()

    def _check(self, row: Row) -> None:
        before = self._rows[-1][0]
        for axis, (value, last) in enumerate(zip(row[0], before, strict=True)):
            low, high = self._travel[axis]
            if low <= value <= high and abs(value - last) <= self._longest[axis]:
                continue
            name, number = self._program.axes[axis], self._first + len(self._rows)
            unit = "degrees" if name in _ROTARY else "mm"
            where = f"row {number} of the interpolator sends {name} from {last:g} to {value:g} {unit}"
            if not low <= value <= high:
                raise ContractError(
                    f"{where}; it travels from {low:g} to {high:g} {unit}", self._program.about["interpolator"]
                )
            speed = abs(value - last) / self._T
            raise ContractError(
                f"{where} in one sample, {speed:g} {unit}/s; it moves at {self._velocity[axis]:g} {unit}/s "
                "at most: let each row follow the one before at the segment's feed rate",
                self._program.about["interpolator"],
            )

    def _evaluate(self, slope: float) -> None:
        rate, at = self.rate, int(self.place)
        q = self.place - at
        p, v, a, _ = self._row(at)
        if q == 0.0 and rate == 1.0 and slope == 0.0:
            self.position, self.velocity, self.acceleration = list(p), list(v), list(a)
            return
        T = self._T
        p1, v1, a1, _ = self._row(at + 1)
        self.position, self.velocity, self.acceleration = [], [], []
        for here, speed, push, there, speed1, push1 in zip(p, v, a, p1, v1, a1, strict=True):
            way = there - here
            m0, m1 = _gentle(speed * T, way), _gentle(speed1 * T, way)
            c2, c3 = 3.0 * way - 2.0 * m0 - m1, m0 + m1 - 2.0 * way
            self.position.append(here + q * (m0 + q * (c2 + q * c3)))
            along = (m0 + q * (2.0 * c2 + q * 3.0 * c3)) / T
            self.velocity.append(rate * along)
            self.acceleration.append(rate * rate * (push + q * (push1 - push)) + slope * along)


def _gentle(slope: float, way: float) -> float:
    """A slope at a row that does not turn the cubic back on a straight way."""
    return max(0.0, min(slope, 3.0 * way)) if way >= 0.0 else min(0.0, max(slope, 3.0 * way))
