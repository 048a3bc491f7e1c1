"""Samples that an interpolator makes while they are carried out: the feed override and the feed hold on them.

At a rate of 1 each row of the interpolator is sent as it is, and one more is made at each sample. At another rate the
path between two rows is the cubic through their positions and velocities, with no slope steeper than three times the
straight line's, so that it never turns back between them. What comes is not known, so the rate changes only as fast as
the largest feed of the path would allow with a share of each axis's acceleration and jerk. A ramp to 1 ends at a row,
and from there on the rows are sent. Above 1 the rate goes only along rows that are made already: as many as are passed
until it can be back at 1, and each leaves room for it in the velocity and the acceleration of every axis.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import islice, repeat
from math import ceil, floor

import numpy as np

from rds.core.errors import ContractError
from rds.modes.loop.program import InterpolatedProgram, ProgramEvent, Row, dwell_samples
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

LEAST_AHEAD = 3  # rows: a ramp that ends at a row may pass more than one of them in a sample
_SHARE = 0.5  # of an axis's acceleration and jerk for a change of the rate; the path's own motion has the rest
_LANDS_WITH = 0.25  # of them for ending at a row
_MOST = 2.0  # the rate
_WORTH = 1.02  # times the rate now, that a higher one must be
_ROUND = 100.0  # a rate above 1 that is not the wanted one is a whole number of per cent
_FILLS = 2  # rows that are made at a sample beside those that are passed, for a rate above 1
_FASTEST = 1.5  # times an axis's velocity that a row may ask for: the drive would follow, and nobody meant it
_ROUNDED = 0.02  # mm or degrees that rounding to BLU may add to a row, or two of the BLU where that is more
_BEYOND = 1e-6  # mm that the last digits of a path may lie beyond the travel
_ROTARY = "ABC"
_UNKNOWN = 1 << 50  # samples: the end is not in sight


class Interpolated(VariableRate):
    """Implements `execution.Follower` for rows that are made on the way; `place` counts rows.

    ContractError for a row that no axis could go to: out of its travel, or much faster than it moves.
    """

    def __init__(self, program: InterpolatedProgram, T: float):
        super().__init__()
        self._program, self._T = program, T
        self._lines = program.line
        velocity, acceleration, jerk = np.asarray(program.limits, dtype=float)
        self._velocity = velocity.tolist()
        self._step, self._bend = (velocity * T).tolist(), (_SHARE * acceleration * T * T).tolist()
        self._ahead = program.ahead
        self._bounds: deque[float] | None = None  # of the rows: what the rate may be; kept while more than 1 is wanted
        self._ways: dict[tuple[float, float], tuple[Ramp, int]] = {}
        self._longest = (_FASTEST * velocity * T + max(_ROUNDED, 2.0 * program.blu)).tolist()
        self._travel = [(low - _BEYOND, high + _BEYOND) for low, high in program.travel.tolist()]
        # s and s² that a change of the rate by 1 takes at the largest feed, of the weakest axis
        slow, sharp = program.feed / float(acceleration.min()), program.feed / float(jerk.min())
        self._slow, self._sharp = STEEPEST * slow / _SHARE, SHARPEST * sharp / _SHARE
        landing = (EXTRA_STEEPEST * slow * FURTHEST * T / _LANDS_WITH) ** 0.5
        self._landing = ceil(max(landing, (EXTRA_SHARPEST * sharp * FURTHEST * T / _LANDS_WITH) ** (1.0 / 3.0)) / T)
        zero = [0.0] * len(program.axes)
        self._rows: deque[Row] = deque([(list(program.start), zero, zero, 0)])
        self._first = 0  # the number of the first row that is kept
        self.happenings: list[ProgramEvent] = []
        self.last = _UNKNOWN
        self._left = iter(program.stretches)
        self._stretch: Iterator[Row] | None = None
        self._due: tuple[ProgramEvent, ...] = program.first
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
        if wanted > 1.0 or self.rate > 1.0:
            wanted = self._faster(wanted)
        elif self._bounds is not None:
            self._bounds, self._ahead = None, self._program.ahead
        if self._ramp is None and wanted != self.rate:
            self._go_along(self._towards(self.rate, wanted))
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

    def _towards(self, rate: float, wanted: float) -> Ramp:
        """A ramp from a rate towards `wanted`, as long as the weakest axis needs."""
        change, samples = in_steps(
            wanted - rate, lambda size: max(SHORTEST, self._slow * size, (self._sharp * size) ** 0.5), self._T
        )
        end = wanted if change == wanted - rate else rate + change
        return Ramp(rate, end, max(samples, self._landing) if end == 1.0 else samples)

    def _faster(self, wanted: float) -> float:
        """The rate to go for where a rate above 1 is wanted, or is left: one that the rows ahead bear."""
        if self._bounds is None:
            kept = list(self._rows)
            self._bounds = deque([_MOST] * min(len(kept), 2))
            self._bounds.extend(self._bound(*kept[k - 2 : k + 1]) for k in range(2, len(kept)))
        rate = self.rate
        if self._ramp is not None:
            return rate
        if rate < 1.0:
            return min(wanted, 1.0)
        if rate > 1.0 and (wanted < rate or self._lowest(self._way(rate, rate)[1]) < rate):
            return 1.0  # any slower one by way of it
        ramp, rows = self._way(rate, min(wanted, _MOST))
        self._ahead = max(self._program.ahead, min(self._ahead + _FILLS, rows))
        made = self._first + len(self._rows) - 1 - int(self.place)
        if self.last == _UNKNOWN and made < rows:
            return rate
        low = self._lowest(rows)
        if low < ramp.end:
            low = floor(low * _ROUND) / _ROUND
            return low if low > _WORTH * rate else rate
        return ramp.end

    def _way(self, rate: float, wanted: float) -> tuple[Ramp, int]:
        """The ramp from `rate` towards `wanted`, and how many rows are passed until the rate is back at 1 after it."""
        if (rate, wanted) not in self._ways:
            ramp = first = self._towards(rate, wanted) if wanted != rate else Ramp(rate, rate, 1)
            rows = first.passed(first.samples)
            while ramp.end > 1.0:
                ramp = self._towards(ramp.end, 1.0)
                rows += ramp.passed(ramp.samples)
            self._ways[rate, wanted] = first, ceil(rows) + LEAST_AHEAD + 1
        return self._ways[rate, wanted]

    def _lowest(self, rows: int) -> float:
        """What the rate may be along the next rows."""
        assert self._bounds is not None
        at = int(self.place) - self._first
        return min(islice(self._bounds, at, at + rows), default=_MOST)

    def _bound(self, before: Row, last: Row, row: Row) -> float:
        """The highest rate at which this row, and the bend of the path before it, leave room for a change of rate."""
        bound = _MOST
        for a, b, c, step, bend in zip(before[0], last[0], row[0], self._step, self._bend, strict=True):
            way, turn = abs(c - b), abs(c - 2.0 * b + a)
            if way * bound > step:
                bound = step / way
            if turn * bound * bound > bend:
                bound = (bend / turn) ** 0.5
        return bound

    # --- the rows -------------------------------------------------------------------------------------------------

    def _row(self, sample: int) -> Row:
        return self._rows[min(max(sample - self._first, 0), len(self._rows) - 1)]

    def _fill(self) -> None:
        """Let the interpolator make rows until there are enough beyond where it is; forget those that are passed."""
        rows, at = self._rows, int(self.place)
        while self._first < at and len(rows) > 1:
            rows.popleft()
            self._first += 1
            if self._bounds is not None:
                self._bounds.popleft()
        while self._first + len(rows) - 1 < at + self._ahead and self.last == _UNKNOWN:
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
            if self._bounds is not None:
                k = len(self._rows)
                known = k > 2  # else the bend is not
                self._bounds.append(self._bound(*(self._rows[k - n] for n in (3, 2, 1))) if known else _MOST)

    def _rests(self) -> None:
        """What is due where the rows have come to; a dwell has rows of its own."""
        position, _, _, segment = self._rows[-1]
        sample = self._first + len(self._rows) - 1
        zero = [0.0] * len(position)
        if self._bounds and len(self._rows) > 1:  # it comes to rest here, from whatever speed
            self._bounds[-1] = min(self._bounds[-1], self._bound(self._rows[-2], self._rows[-1], self._rows[-1]))
        for happening in self._due:
            self.happenings.append(happening._replace(sample=sample))
            if happening.kind == "dwell":
                count = dwell_samples(happening.value, self._T)
                self._rows.extend(repeat((position, zero, zero, segment), count))
                if self._bounds is not None:
                    self._bounds.extend(repeat(_MOST, count))
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
