"""How fast along the path: the limits of each piece and joint, and the fastest profile within them.

The profile has piecewise constant acceleration and looks as far ahead as it is handed pieces. Its samples are then
averaged over τ seconds (sampling.py), which bounds the jerk: an average over τ of a speed whose acceleration is at most
a, and changes its sign at intervals of τ at least, has a jerk of a/τ at most. Averaging mixes what is up to τ/2 before
and after; so each limit c of the speed holds c·τ/2 further to either side than the piece it is of, which is as far as
one comes. Then at every time the averaged motion keeps the limits of the place where it is.

Where direction or curvature jump (joints on an exact path), third differences of samples at T see the velocity jump Δv
as Δv/T² at most, and the jump of acceleration Δa as 3/4 Δa/T; what is within 3 T adds up.
"""

from __future__ import annotations

from math import fabs, inf, sqrt

import numpy as np

from rds.core.compiling import tiered_kernel
from rds.interpolators.motion.path import TURN_SHARE
from rds.interpolators.motion.pieces import (
    BEND,
    BEND_0,
    BEND_1,
    CAP,
    FEED,
    LENGTH,
    PUSH,
    SHARE,
    SLOPE,
    SLOPE_0,
    SLOPE_1,
    TWIST,
)

BEND_SHARE = 0.3  # of the jerk, for jumps of the curvature at joints


@tiered_kernel
def piece_limits(f, velocity, acceleration, jerk, tau):
    """Fill CAP and PUSH of the rows f: highest dq/dt and d²q/dt².

    With slope, bend and twist the bounds of |dp/dq|, |d²p/dq²|, |d³p/dq³| of an axis, c = dq/dt and a = d²q/dt²:
    c² bend + a slope ≤ acceleration, c³ twist + 3 c a bend + a/τ slope ≤ jerk.
    """
    for k in range(len(f)):
        c = f[k, FEED]
        for i in range(6):
            if f[k, SLOPE + i] > 0.0:
                c = min(c, velocity[i] / f[k, SLOPE + i])
            if f[k, BEND + i] > 0.0:
                c = min(c, sqrt(f[k, SHARE] * acceleration[i] / f[k, BEND + i]))
            if f[k, TWIST + i] > 0.0:
                c = min(c, (f[k, SHARE] * jerk[i] / f[k, TWIST + i]) ** (1.0 / 3.0))
        a = inf
        for i in range(6):
            slope, bend, twist = f[k, SLOPE + i], f[k, BEND + i], f[k, TWIST + i]
            if slope > 0.0:
                a = min(a, (acceleration[i] - c * c * bend) / slope)
            if slope > 0.0 or bend > 0.0:
                a = min(a, (jerk[i] - c * (c * c) * twist) / (3.0 * c * bend + slope / tau))
        f[k, CAP], f[k, PUSH] = c, a


@tiered_kernel
def joint_limits(f, at, acceleration, jerk, tau, T):
    """Highest speed, acceleration and reach (to either side) of the joints where something jumps: rows of
    (place, speed, acceleration, reach). `at` holds the place of each piece's start."""
    n = len(f)
    found = np.empty((max(n - 1, 0), 4))
    first_guess = np.empty(max(n - 1, 0))
    for j in range(n - 1):
        c = min(f[j, CAP], f[j + 1, CAP])
        guess = c
        for i in range(6):
            turn = fabs(f[j + 1, SLOPE_0 + i] - f[j, SLOPE_1 + i])
            bend = fabs(f[j + 1, BEND_0 + i] - f[j, BEND_1 + i])
            if turn * c > 1e-5 * jerk[i] * T * T:
                guess = min(guess, TURN_SHARE * jerk[i] * T * T / turn)
            if bend * c * c > 1e-5 * jerk[i] * T:
                guess = min(guess, sqrt(BEND_SHARE * jerk[i] * T / (0.75 * bend)))
        first_guess[j] = guess
    count = 0
    for j in range(n - 1):
        guess = first_guess[j]
        some = False
        for i in range(6):
            turn = fabs(f[j + 1, SLOPE_0 + i] - f[j, SLOPE_1 + i])
            bend = fabs(f[j + 1, BEND_0 + i] - f[j, BEND_1 + i])
            some = some or turn * guess > 1e-5 * jerk[i] * T * T or bend * (guess * guess) > 1e-5 * jerk[i] * T
        if not some:
            continue
        place = at[j + 1]
        # the joints that are passed within 3 T, and the pieces within 3/2 T
        low, high = j, j
        while low > 0 and place - at[low] <= 1.5 * T * (guess + f[low, CAP]):
            low -= 1
        while high < n - 2 and at[high + 2] - place <= 1.5 * T * (guess + f[high + 1, CAP]):
            high += 1
        c = guess
        for i in range(6):
            turns = bends = 0.0
            for k in range(low, high + 1):
                if k == j or fabs(at[k + 1] - place) <= 1.5 * T * (guess + first_guess[k]):
                    turns += fabs(f[k + 1, SLOPE_0 + i] - f[k, SLOPE_1 + i])
                    bends += fabs(f[k + 1, BEND_0 + i] - f[k, BEND_1 + i])
            if turns > 0.0:
                c = min(c, TURN_SHARE * jerk[i] * T * T / turns, 0.3 * acceleration[i] * T / turns)
            if bends > 0.0:
                c = min(c, sqrt(BEND_SHARE * jerk[i] * T / (0.75 * bends)))
            twist = 0.0
            for k in range(low, high + 2):
                twist = max(twist, f[k, TWIST + i])
            if twist > 0.0:
                c = min(c, (0.3 * jerk[i] / twist) ** (1.0 / 3.0))
        a = inf
        for i in range(6):
            turns = bends = slope = bend = twist = 0.0
            for k in range(low, high + 1):
                if k == j or fabs(at[k + 1] - place) <= 1.5 * T * (guess + first_guess[k]):
                    turns += fabs(f[k + 1, SLOPE_0 + i] - f[k, SLOPE_1 + i])
                    bends += fabs(f[k + 1, BEND_0 + i] - f[k, BEND_1 + i])
            for k in range(low, high + 2):
                slope = max(slope, f[k, SLOPE + i])
                bend = max(bend, f[k, BEND + i])
                twist = max(twist, f[k, TWIST + i])
            if slope > 0.0:
                left = jerk[i] - c * turns / (T * T) - 0.75 * c * c * bends / T - c * (c * c) * twist
                a = min(a, left / (3.0 * c * bend + slope / tau + 0.75 * turns / T))
                a = min(a, (acceleration[i] - c * turns / T - c * c * bend) / slope)
        found[count, 0], found[count, 1], found[count, 2], found[count, 3] = place, c, a, 1.5 * T * c
        count += 1
    return found[:count]


@tiered_kernel
def _lowest(low, high, values, edges):
    """The lowest of `values` whose range [low, high] covers each interval between two edges."""
    lowest = np.empty(len(edges) - 1)
    free = np.arange(len(edges))  # the next interval without a value
    for k in np.argsort(values):
        i = np.searchsorted(edges, low[k])
        last = np.searchsorted(edges, high[k])
        while True:
            root = i
            while free[root] != root:
                root = free[root]
            while free[i] != root:
                i, free[i] = free[i], root
            i = root
            if i >= last:
                break
            lowest[i] = values[k]
            free[i] = i + 1
    return lowest


@tiered_kernel
def envelope(f, at, joints, tau, start, end):
    """Edges from `start` to `end`, highest speed and acceleration between them; each limit reaches c·τ/2 further."""
    n, m = len(f), len(joints)
    low, high = np.empty(n + m), np.empty(n + m)
    speed, push = np.empty(n + m), np.empty(n + m)
    for k in range(n):
        reach = 0.5 * tau * f[k, CAP]
        low[k], high[k], speed[k], push[k] = at[k] - reach, at[k] + f[k, LENGTH] + reach, f[k, CAP], f[k, PUSH]
    for k in range(m):
        reach = joints[k, 3] + 0.5 * tau * joints[k, 1]
        low[n + k], high[n + k] = joints[k, 0] - reach, joints[k, 0] + reach
        speed[n + k], push[n + k] = joints[k, 1], joints[k, 2]
    low = np.minimum(np.maximum(low, start), end)
    high = np.minimum(np.maximum(high, start), end)
    edges = np.unique(np.concatenate((low, high, np.array([start, end]))))
    return edges, _lowest(low, high, speed, edges), _lowest(low, high, push, edges)
