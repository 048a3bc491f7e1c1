"""Samples of the motion: the speed profile averaged over τ, and the pieces where it then is."""

from __future__ import annotations

import numpy as np

from rds.core.compiling import kernel
from rds.interpolators.motion.pieces import AXIS_1, AXIS_2, DISTANCE, KIND, LENGTH, RATIO, evaluate

# Columns of a timed phase: start time, duration, place and speed at its start, acceleration.
SINCE, LASTS, PLACE, SPEED, RATE = range(5)


@kernel
def timed(phases, time, place):
    """Phases (length, speed at start and end) with their times, from `time` and `place` on."""
    rows = np.empty((len(phases), 5))
    for i in range(len(phases)):
        length, u, w = phases[i, 0], phases[i, 1], phases[i, 2]
        lasts = 2.0 * length / (u + w) if length > 0.0 else 0.0
        rate = (w - u) / lasts if lasts > 0.0 else 0.0  # so slow that its ramps are shorter than rounding
        rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4] = time, lasts, place, u, rate
        time += lasts
        place += length
    return rows


@kernel
def _at(rows, i, time):
    """Place and speed at a time of phase i, which before the first phase and after the last stand still."""
    since = min(max(time - rows[i, SINCE], 0.0), rows[i, LASTS])
    speed = rows[i, SPEED] + rows[i, RATE] * since
    return rows[i, PLACE] + (rows[i, SPEED] + 0.5 * rows[i, RATE] * since) * since, speed


@kernel
def sample(rows, tau, T, first, count, f, u, at, position, velocity, acceleration, distance, piece):
    """Fill samples `first` to first + count − 1, sample k being at the mean of the profile from kT − τ to kT.

    rows: timed phases that cover this time (before and after them the motion stands still). f, u, at: pieces and the
    places of their starts. piece: the number of each sample's.
    """
    p, dp, ddp = np.empty(6), np.empty(6), np.empty(6)
    lo = hi = here = 0
    n = len(rows)
    for k in range(count):
        end = (first + k) * T
        begin = end - tau
        while lo < n - 1 and rows[lo + 1, SINCE] <= begin:
            lo += 1
        hi = max(hi, lo)
        while hi < n - 1 and rows[hi + 1, SINCE] <= end:
            hi += 1
        s_lo, v_lo = _at(rows, lo, begin)
        s_hi, v_hi = _at(rows, hi, end)
        # the mean of place − s_lo, phase by phase; the rests before the first and after the last phase count too
        total = 0.0
        for i in range(lo, hi + 1):
            start = max(begin, rows[i, SINCE]) - rows[i, SINCE]
            stop = min(end, rows[i, SINCE] + rows[i, LASTS]) - rows[i, SINCE]
            if stop > start:
                d, a = stop - start, rows[i, RATE]
                v = rows[i, SPEED] + a * start
                s = rows[i, PLACE] - s_lo + (rows[i, SPEED] + 0.5 * a * start) * start
                total += d * (s + d * (0.5 * v + d * a / 6.0))
        after = end - max(begin, rows[hi, SINCE] + rows[hi, LASTS])
        if after > 0.0:
            total += after * (s_hi - s_lo)
            v_hi = 0.0
        if begin < rows[0, SINCE]:
            v_lo = 0.0
        s = s_lo + total / tau
        v = (s_hi - s_lo) / tau
        a = (v_hi - v_lo) / tau
        while here < len(f) - 1 and at[here + 1] <= s:
            here += 1
        q = min(max(s - at[here], 0.0), f[here, LENGTH])
        evaluate(f[here], u[here, KIND], u[here, AXIS_1], u[here, AXIS_2], q, p, dp, ddp)
        for i in range(6):
            position[k, i] = p[i]
            velocity[k, i] = dp[i] * v
            acceleration[k, i] = ddp[i] * v * v + dp[i] * a
        distance[k] = f[here, DISTANCE] + f[here, RATIO] * q
        piece[k] = here
