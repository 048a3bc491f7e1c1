"""Samples of the motion: the speed profile averaged over τ, in phases of constant jerk, and the pieces of the path."""

from __future__ import annotations

import numpy as np

from rds.core.compiling import tiered_kernel
from rds.interpolators.motion.pieces import AXIS_1, AXIS_2, DISTANCE, KIND, LENGTH, RATIO, SHAPE, STRAIGHT, evaluate

# Columns of a timed phase: start time, duration, place and speed at its start, acceleration; and of constant jerk.
SINCE, LASTS, PLACE, SPEED, RATE, JERK = range(6)
_SHORTEST = 1e-12  # s, of a phase: what is shorter is rounding


@tiered_kernel
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


@tiered_kernel
def _at(rows, i, time):
    """Place and speed at a time of phase i, which before the first phase and after the last stand still."""
    since = min(max(time - rows[i, SINCE], 0.0), rows[i, LASTS])
    speed = rows[i, SPEED] + rows[i, RATE] * since
    return rows[i, PLACE] + (rows[i, SPEED] + 0.5 * rows[i, RATE] * since) * since, speed


@tiered_kernel
def averaged(rows, tau, begin, end, since, out, count):
    """The mean of timed phases over the τ before each time from `begin` to `end`, in phases of constant jerk.

    They start at the time `since` and become rows of `out` from `count` on. Returned are the number of rows after them
    and the time of their end. Before and after its phases the profile stands still.
    """
    n = len(rows)
    lo = hi = 0
    stop = rows[n - 1, SINCE] + rows[n - 1, LASTS]
    time = begin
    while time < end:
        first = time - tau
        while lo < n - 1 and rows[lo + 1, SINCE] <= first + _SHORTEST:
            lo += 1
        hi = max(hi, lo)
        while hi < n - 1 and rows[hi + 1, SINCE] <= time + _SHORTEST:
            hi += 1
        until = end  # the next time at which a phase enters or leaves the mean
        if hi < n - 1:
            until = min(until, rows[hi + 1, SINCE])
        elif time < stop - _SHORTEST:
            until = min(until, stop)
        if first < rows[0, SINCE] - _SHORTEST:
            until = min(until, rows[0, SINCE] + tau)
        elif lo < n - 1:
            until = min(until, rows[lo + 1, SINCE] + tau)
        s_lo, v_lo = _at(rows, lo, first)
        s_hi, v_hi = _at(rows, hi, time)
        rate_lo, rate_hi = rows[lo, RATE], rows[hi, RATE]
        if first < rows[0, SINCE] - _SHORTEST:
            v_lo = rate_lo = 0.0
        # the mean of place − s_lo, phase by phase; the rests before the first and after the last phase count too
        total = 0.0
        for i in range(lo, hi + 1):
            start = max(first, rows[i, SINCE]) - rows[i, SINCE]
            over = min(time, rows[i, SINCE] + rows[i, LASTS]) - rows[i, SINCE]
            if over > start:
                d, a = over - start, rows[i, RATE]
                v = rows[i, SPEED] + a * start
                s = rows[i, PLACE] - s_lo + (rows[i, SPEED] + 0.5 * a * start) * start
                total += d * (s + d * (0.5 * v + d * a / 6.0))
        after = time - max(first, stop)
        if hi == n - 1 and time >= stop - _SHORTEST:
            total += max(after, 0.0) * (s_hi - s_lo)
            v_hi = rate_hi = 0.0
        if until > time + _SHORTEST or until >= end:
            out[count, SINCE], out[count, LASTS], out[count, PLACE] = since, until - time, s_lo + total / tau
            out[count, SPEED], out[count, RATE] = (s_hi - s_lo) / tau, (v_hi - v_lo) / tau
            out[count, JERK] = (rate_hi - rate_lo) / tau
            count += 1
            since += until - time
        time = until
    return count, since


@tiered_kernel
def sample(phases, T, first, count, f, u, at, position, velocity, acceleration, distance, piece):
    """Fill samples `first` to first + count − 1, sample k being at the time kT of the phases, which cover these times.

    f, u, at: pieces and the places of their starts. piece: the number of each sample's.
    """
    p, dp, ddp = np.empty(6), np.empty(6), np.empty(6)
    i = here = 0
    n = len(phases)
    for k in range(count):
        time = (first + k) * T
        while i < n - 1 and phases[i + 1, SINCE] <= time:
            i += 1
        t = min(max(time - phases[i, SINCE], 0.0), phases[i, LASTS])
        jerk, rate = phases[i, JERK], phases[i, RATE]
        s = phases[i, PLACE] + t * (phases[i, SPEED] + t * (0.5 * rate + t * jerk / 6.0))
        v, a = phases[i, SPEED] + t * (rate + 0.5 * t * jerk), rate + t * jerk
        while here < len(f) - 1 and at[here + 1] <= s:
            here += 1
        q = min(max(s - at[here], 0.0), f[here, LENGTH])
        if u[here, KIND] == STRAIGHT:
            for j in range(6):
                slope = f[here, SHAPE + 6 + j]
                position[k, j] = f[here, SHAPE + j] + slope * q
                velocity[k, j] = slope * v
                acceleration[k, j] = slope * a
        else:
            evaluate(f[here], u[here, KIND], u[here, AXIS_1], u[here, AXIS_2], q, p, dp, ddp)
            for j in range(6):
                position[k, j] = p[j]
                velocity[k, j] = dp[j] * v
                acceleration[k, j] = ddp[j] * v * v + dp[j] * a
        distance[k] = f[here, DISTANCE] + f[here, RATIO] * q
        piece[k] = here
