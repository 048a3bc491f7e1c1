"""The speed profile: fastest within an envelope of speed and acceleration, in phases of constant acceleration.

A phase is a row (length, speed at its start, speed at its end).
"""

from __future__ import annotations

from math import fabs, sqrt

import numpy as np

from rds.core.compiling import tiered_kernel
from rds.interpolators.motion.pieces import square

ALL = 1.0 - 1e-6  # of a length: a ramp that takes so much of it takes all of it


@tiered_kernel
def speeds(edges, cap, push, first, last):
    """Highest speeds at the edges, from `first` on, at most `last` at the end; `cap`, `push`: limits between edges."""
    n = len(cap)
    v = np.empty(n + 1)
    v[0] = first
    for e in range(n):
        reached = sqrt(v[e] * v[e] + 2.0 * push[e] * (edges[e + 1] - edges[e]))
        v[e + 1] = min(cap[e], last, reached) if e == n - 1 else min(cap[e], cap[e + 1], reached)
    for e in range(n - 1, 0, -1):
        v[e] = min(v[e], sqrt(v[e + 1] * v[e + 1] + 2.0 * push[e] * (edges[e + 1] - edges[e])))
    return v


@tiered_kernel
def settled(edges, cap, push, first, v):
    """The last edge up to which the speeds v, that end at rest, are what they would be if they did not."""
    free = speeds(edges, cap, push, first, np.inf)
    e = 0
    while e < len(v) - 1 and v[e + 1] == free[e + 1]:
        e += 1
    return edges[e]


@tiered_kernel
def phases_of(edges, cap, push, v):
    """Phases through the speeds v at the edges, as fast as may be between them."""
    n = len(cap)
    phases = np.empty((3 * n, 3))
    count = 0
    for e in range(n):
        length, a, c = edges[e + 1] - edges[e], push[e], cap[e]
        v0, v1 = v[e], v[e + 1]
        top = min(c, sqrt(0.5 * (v0 * v0 + v1 * v1) + a * length))
        up, down = (top * top - v0 * v0) / (2.0 * a), (top * top - v1 * v1) / (2.0 * a)
        if up < 1e-9 * length and v0 > 0.0:  # at a very slow feed even a ramp from rest is so short
            up, top = 0.0, v0
            down = (top * top - v1 * v1) / (2.0 * a)
        if down < 1e-9 * length and v1 > 0.0:
            down, top = 0.0, v1
            up = length if up > ALL * length and v0 < v1 else min(up, length)
        if up == 0.0 and v1 < v0:  # what starts below the highest speed by rounding only has a steady part
            down = length if down > ALL * length else down
        steady = max(length - up - down, 0.0)
        if up > 0.0:
            phases[count, 0], phases[count, 1], phases[count, 2] = up, v0, top
            count += 1
        if steady > 0.0:
            phases[count, 0], phases[count, 1], phases[count, 2] = steady, top, top
            count += 1
        if down > 0.0:
            phases[count, 0], phases[count, 1], phases[count, 2] = down, top, v1
            count += 1
    return phases[:count]


@tiered_kernel
def hold_tops(phases, tau):
    """The phases with each top of the speed held for τ at least, by lowering it.

    Between speeding up and slowing down lie then τ seconds without acceleration. (Between slowing down and speeding up
    they do anyway, as each limit of the speed reaches far enough to either side.) A top that is lowered to the valley
    beside it lasts as long as both: so what is left of it stands in `out`, whose end is taken back where need be.
    """
    n = len(phases)
    out = np.empty((n + n, 3))
    count = i = 0
    while i < n:
        while i < n and phases[i, 2] >= phases[i, 1]:
            out[count] = phases[i]
            count += 1
            i += 1
        k = i  # slowing down from here
        while k < n and phases[k, 2] <= phases[k, 1]:
            k += 1
        right = i  # the next phase to be lowered on this side; on the other it is the last of `out`
        level = out[count - 1, 2] if count > 0 else phases[right, 1]
        length = 0.0
        while True:
            flat = 1e-12 * level * level  # a phase that changes the speed by rounding only has no slope to go down
            if count > 0 and fabs(square(out[count - 1, 2]) - square(out[count - 1, 1])) <= flat:
                count -= 1
                length += out[count, 0]
                continue
            if right < k and (phases[right, 2] >= level or square(phases[right, 1]) - square(phases[right, 2]) <= flat):
                length += phases[right, 0]
                right += 1
                continue
            last = count - 1
            if length >= level * tau or last < 0 or right >= k or out[last, 2] < out[last, 1]:
                break
            u, w = out[last, 1], phases[right, 2]
            gain_left = out[last, 0] / (square(out[last, 2]) - u * u)
            gain_right = phases[right, 0] / (square(phases[right, 1]) - w * w)
            gain = gain_left + gain_right
            lower = (sqrt(tau * tau + 4.0 * gain * (length + gain * level * level)) - tau) / (2.0 * gain)
            below = max(lower, u, w)
            cut_off = level * level - below * below
            cut_left, cut_right = gain_left * cut_off, gain_right * cut_off
            length += cut_left + cut_right
            if below == u:
                count -= 1
            else:
                out[last, 0] -= cut_left
                out[last, 2] = below
            if below == w:
                right += 1
            else:
                phases[right, 0] -= cut_right
                phases[right, 1] = below
            level = below
            if lower >= u and lower >= w:
                break
        if length > 0.0:
            out[count, 0], out[count, 1], out[count, 2] = length, level, level
            count += 1
        for m in range(right, k):
            out[count] = phases[m]
            count += 1
        i = k
    return out[:count]


@tiered_kernel
def cut(phases, length):
    """The phases up to `length` from their start."""
    for i in range(len(phases)):
        if phases[i, 0] >= length:
            u, w = phases[i, 1], phases[i, 2]
            out = phases[: i + 1].copy()
            out[i, 0], out[i, 2] = length, sqrt(u * u + (w * w - u * u) * (length / phases[i, 0]))
            return out
        length -= phases[i, 0]
    return phases
