"""The least time along a planned path within velocity and acceleration of each axis, without a limit of the jerk.

It is what a motion's time is compared with: no motion along the path is faster, whatever jerk the axes can do. With x
the square of dq/dt and u = d²q/dt², each axis allows |p′ u + p″ x| ≤ acceleration, linear in both. One pass from the
end back finds the highest x of each place from which the rest of the path can be passed, one pass forward then takes
the highest u (Pham and Pham, "A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis",
IEEE Transactions on Robotics, 2018). Both ends of each interval keep the limits. On straight pieces this is exact; arcs
and blends are divided.
"""

from __future__ import annotations

from math import fabs, inf, pi, sqrt

import numpy as np

from rds.core.compiling import tiered_kernel
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.pieces import (
    AXIS_1,
    AXIS_2,
    BLENDED,
    CIRCULAR,
    FEED,
    KIND,
    LENGTH,
    REST,
    SHAPE,
    SLOPE_0,
    SLOPE_1,
    evaluate,
    no_pieces,
    square,
)

OF_BLEND = 12  # intervals
OF_ARC = pi / 90.0  # rad, of an interval at most
OF_RAMP = 0.02  # of the way in which the speed of an arc is reached: the first interval of an arc, and its last
GROWTH = 1.25  # of an interval to that before it, from either end
ENOUGH = 4096  # pieces that are gathered before they are looked at
LONGEST = 1 << 18  # pieces: after so many the motion is taken to rest
# Columns of an interval: its length, the highest x at its start and in it, p′ and p″ at its start and at its end.
WAY, MOST, HIGHEST, FROM, TO = 0, 1, 2, 3, 15
COLUMNS = 27


@tiered_kernel
def intervals(f, u, velocity, acceleration, T):
    """The intervals of pieces (floats f, whole numbers u) as rows, and the number of rows of each piece."""
    n = len(f)
    counts = np.ones(n, np.int64)
    firsts, steps = np.zeros(n), np.zeros(n)
    for k in range(n):
        firsts[k] = steps[k] = f[k, LENGTH]
        if u[k, KIND] == BLENDED:
            counts[k] = OF_BLEND
            firsts[k] = steps[k] = f[k, LENGTH] / OF_BLEND
        elif u[k, KIND] == CIRCULAR:
            steps[k] = OF_ARC / fabs(f[k, SHAPE + 14])
            for i in range(6):
                if acceleration[i] > 0.0:
                    firsts[k] = min(firsts[k], OF_RAMP * square(min(f[k, FEED], velocity[i])) / acceleration[i])
            way, step, half = 0.0, firsts[k], 0
            while way < 0.5 * f[k, LENGTH]:
                way += step
                half += 1
                step = min(step * GROWTH, steps[k])
            firsts[k], steps[k] = firsts[k] * 0.5 * f[k, LENGTH] / way, steps[k] * 0.5 * f[k, LENGTH] / way
            counts[k] = 2 * half
    rows = np.empty((counts.sum(), COLUMNS))
    p, dp, ddp = np.empty(6), np.empty(6), np.empty(6)
    r = 0
    for k in range(n):
        joint = inf  # where the direction jumps, that is a change of the velocity within one sample
        if k > 0:
            for i in range(6):
                turn = fabs(f[k, SLOPE_0 + i] - f[k - 1, SLOPE_1 + i])
                if turn > 1e-9:
                    joint = min(joint, acceleration[i] * T / turn)
        step, begin = firsts[k], 0.0
        for m in range(counts[k]):
            if u[k, KIND] == CIRCULAR and m > 0 and 2 * m != counts[k]:
                step = min(step * GROWTH, steps[k]) if 2 * m < counts[k] else rows[r - 2 * m + counts[k] - 1, WAY]
            rows[r, WAY] = step
            for side in range(2):
                evaluate(f[k], u[k, KIND], u[k, AXIS_1], u[k, AXIS_2], begin + side * step, p, dp, ddp)
                place = FROM + 12 * side
                rows[r, place : place + 6], rows[r, place + 6 : place + 12] = dp, ddp
            highest = f[k, FEED]
            for i in range(6):
                for side in range(2):
                    slope, bend = fabs(rows[r, FROM + 12 * side + i]), fabs(rows[r, FROM + 12 * side + 6 + i])
                    if slope > 0.0:
                        highest = min(highest, velocity[i] / slope)
                    if bend > 0.0 and slope < 1e-12:
                        highest = min(highest, sqrt(acceleration[i] / bend))
            rows[r, HIGHEST] = highest * highest
            rows[r, MOST] = min(rows[r, HIGHEST], joint * joint) if m == 0 else rows[r, HIGHEST]
            if r > 0:
                rows[r, MOST] = min(rows[r, MOST], rows[r - 1, HIGHEST])
            begin += step
            r += 1
    return rows, counts


@tiered_kernel
def _range(row, acceleration, x, most):
    """Lowest and highest u at x on an interval that ends with x ≤ most, and how fast both change with x."""
    double = 2.0 * row[WAY]
    low, low_slope = -x / double, -1.0 / double
    high, high_slope = (most - x) / double, -1.0 / double
    for side in range(2):
        for i in range(6):
            slope, bend = row[FROM + 12 * side + i], row[FROM + 12 * side + 6 + i]
            if side == 1:
                slope += double * bend
            if slope < 0.0:
                slope, bend = -slope, -bend
            if slope > 1e-12:
                a, b, s = (acceleration[i] - bend * x) / slope, (-acceleration[i] - bend * x) / slope, -bend / slope
                if a < high:
                    high, high_slope = a, s
                if b > low:
                    low, low_slope = b, s
    return low, low_slope, high, high_slope


@tiered_kernel
def _backward(rows, acceleration, end):
    """The highest x at each edge from which the rest of the intervals can be passed, with at most `end` there."""
    n = len(rows)
    top = np.empty(n + 1)
    top[n] = end
    for r in range(n - 1, -1, -1):
        following = min(top[r + 1], rows[r, HIGHEST])
        x = rows[r, MOST]
        for _ in range(60):  # Newton's steps down a convex function of straight parts
            low, low_slope, high, high_slope = _range(rows[r], acceleration, x, following)
            over = low - high
            if over <= 1e-12 * (fabs(low) + fabs(high)):
                break
            x = max(x - over / max(low_slope - high_slope, 1e-300), 0.0)
        top[r] = x
    return top


@tiered_kernel
def _forward(rows, acceleration, top, x, upto):
    """x at edge `upto` and the seconds until there, as fast as may be below `top`."""
    seconds = 0.0
    for r in range(upto):
        following = min(top[r + 1], rows[r, HIGHEST])
        low, _, high, _ = _range(rows[r], acceleration, x, following)
        ended = min(max(x + 2.0 * rows[r, WAY] * max(high, low), 0.0), following)
        bent = False
        for i in range(6):
            bent = bent or rows[r, FROM + 6 + i] != 0.0 or rows[r, TO + 6 + i] != 0.0
        v, w = sqrt(x), sqrt(ended)
        if bent:
            seconds += 2.0 * rows[r, WAY] / (v + w) if v + w > 0.0 else 0.0
        else:  # up, even, down
            a = inf
            for i in range(6):
                if rows[r, FROM + i] != 0.0:
                    a = min(a, acceleration[i] / fabs(rows[r, FROM + i]))
            peak = min(sqrt(0.5 * (x + ended) + a * rows[r, WAY]), sqrt(rows[r, HIGHEST]))
            even = max(rows[r, WAY] - (2.0 * peak * peak - x - ended) / (2.0 * a), 0.0)
            seconds += (2.0 * peak - v - w) / a + even / peak if peak > 0.0 else 0.0
        x = ended
    return x, seconds


class LeastTime:
    """Takes the pieces of a path in (`extend`), and knows after `finish` how long they last at the least: `seconds`.

    limits: of the axes. T: s between samples, within which the direction may jump where nothing is blended. In bounded
    memory: what comes later is looked at only as far as it matters.
    """

    def __init__(self, limits: Limits, T: float):
        self._limits, self._T = limits, T
        self._f, self._u = no_pieces()
        self._waiting: list[tuple[np.ndarray, np.ndarray]] = []
        self._x = 0.0  # the square of dq/dt at the first of these
        self._window = ENOUGH
        self.seconds = 0.0

    def extend(self, f: np.ndarray, u: np.ndarray) -> None:
        """More pieces that follow."""
        self._waiting.append((f.copy(), u.copy()))
        if sum(len(part) for part, _ in self._waiting) + len(self._f) >= self._window:
            self._pass(final=False)

    def rest(self, seconds: float) -> None:
        """The motion rests (G4)."""
        self.seconds += seconds

    def finish(self) -> None:
        """The motion rests after the last piece."""
        self._pass(final=True)

    def _pass(self, final: bool) -> None:
        parts = [(self._f, self._u), *self._waiting]
        self._waiting = []
        f, u = (np.concatenate(column) for column in zip(*parts, strict=True))
        while len(f):
            rests = np.flatnonzero(u[:, REST])
            count = int(rests[0]) + 1 if len(rests) else len(f)
            ends = bool(len(rests)) or final or len(f) >= LONGEST
            if not ends and len(f) < self._window:
                break
            velocity, acceleration = self._limits.velocity, self._limits.acceleration
            rows, counts = intervals(f[:count], u[:count], velocity, acceleration, self._T)
            top = _backward(rows, acceleration, 0.0)
            upto = len(rows)
            if not ends:  # as far as it makes no difference what comes
                free = _backward(rows, acceleration, inf)
                edges = np.concatenate(([0], np.cumsum(counts)))
                same = np.flatnonzero(top[edges] == free[edges])
                count = int(same[-1]) if len(same) else 0
                upto = int(edges[count])
                if count == 0:
                    self._window *= 2
                    break
            self._x, seconds = _forward(rows, acceleration, top, self._x, upto)
            self.seconds += seconds
            f, u = f[count:], u[count:]
            self._window = ENOUGH
            if not ends:
                break
        self._f, self._u = f, u
