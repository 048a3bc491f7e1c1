"""Pieces: what the planned path consists of. Straight lines, arcs, and polynomials that blend two of these.

A piece gives the position p of the six axes over the path parameter q from 0 to its length; on lines and arcs q is the
arc length in six dimensions (mm and degrees alike), on a blend it is that of the path that it replaces, so |dp/dq| is
about 1. All pieces of a plan are rows of two arrays, of floats (columns below) and of whole numbers, for the kernels.
"""

from __future__ import annotations

from math import cos, fabs, sin, sqrt

import numpy as np

from rds.core.compiling import tiered_kernel

# Columns of the floats. Vectors over the six axes take six columns.
LENGTH = 0  # of q
FEED = 1  # highest dq/dt that the programmed feed rate allows
RATIO = 2  # programmed length (mm, degrees) per q
SHAPE = 3  # 6 × 6: see `evaluate`
SLOPE, BEND, TWIST = 39, 45, 51  # largest |dp/dq|, |d²p/dq²|, |d³p/dq³| of each axis
SLOPE_0, BEND_0, SLOPE_1, BEND_1 = 57, 63, 69, 75  # dp/dq and d²p/dq² at its start and at its end
END = 81  # position at its end
DISTANCE = 87  # programmed length from the start of the program to its start
CAP, PUSH = 88, 89  # highest dq/dt and d²q/dt²
SHARE = 90  # of acceleration and jerk, that the path's bends may take; the rest is left for the speed's change
FLOATS = 91
# Columns of the whole numbers: kind; first and last segment that it stands for; whether it ends at rest; the axes of an
# arc's plane.
KIND, FIRST, LAST, REST, AXIS_1, AXIS_2 = range(6)
INTS = 6
STRAIGHT, CIRCULAR, BLENDED = 0, 1, 2
BENDING = 0.7  # what SHARE is to begin with


@tiered_kernel
def square(x):
    """x², rounded once in either way; x ** 2 is not always, in Python."""
    return x * x


@tiered_kernel
def evaluate(f, kind, axis_1, axis_2, q, p, dp, ddp):
    """Position and its first two derivatives by q, into p, dp, ddp.

    SHAPE holds: of a line, start and direction; of an arc, start, what is linear in q, and in the third row the arm
    from the centre to the start (2) and the angle per q; of a blend, the coefficients of q⁰ to q⁵.
    """
    if kind == BLENDED:
        for i in range(6):
            k = SHAPE + i
            p[i] = f[k] + q * (f[k + 6] + q * (f[k + 12] + q * (f[k + 18] + q * (f[k + 24] + q * f[k + 30]))))
            dp[i] = f[k + 6] + q * (2 * f[k + 12] + q * (3 * f[k + 18] + q * (4 * f[k + 24] + q * 5 * f[k + 30])))
            ddp[i] = 2 * f[k + 12] + q * (6 * f[k + 18] + q * (12 * f[k + 24] + q * 20 * f[k + 30]))
        return
    for i in range(6):
        slope = f[SHAPE + 6 + i]
        p[i] = f[SHAPE + i] + slope * q
        dp[i] = slope
        ddp[i] = 0.0
    if kind == CIRCULAR:
        x, y, turn = f[SHAPE + 12], f[SHAPE + 13], f[SHAPE + 14]
        half = sin(0.5 * turn * q)
        s, lost = sin(turn * q), 2.0 * half * half  # sin, 1 − cos without cancellation
        c = 1.0 - lost
        p[axis_1] += -s * y - lost * x
        p[axis_2] += s * x - lost * y
        dp[axis_1] += turn * (-c * y - s * x)
        dp[axis_2] += turn * (c * x - s * y)
        ddp[axis_1] += turn * turn * (s * y - c * x)
        ddp[axis_2] += turn * turn * (-s * x - c * y)


@tiered_kernel
def make_straight(f, start, end, programmed):
    """A line from `start` to `end` into the row f. `programmed` is its programmed length (mm or degrees)."""
    total = 0.0
    for i in range(6):
        total += square(end[i] - start[i])
    total = sqrt(total)
    f[LENGTH] = total
    f[RATIO] = programmed / total if total > 0.0 else 1.0
    for i in range(6):
        f[SHAPE + i] = start[i]
        f[SHAPE + 6 + i] = (end[i] - start[i]) / total if total > 0.0 else 0.0
        f[END + i] = end[i]


@tiered_kernel
def make_circular(f, start, end, centre, sweep, axis_1, axis_2, programmed):
    """An arc or helix into the row f. An end that is a little off the circle is met by a drift along the whole arc.

    Returns how long that drift is, mm.
    """
    x, y = start[axis_1] - centre[axis_1], start[axis_2] - centre[axis_2]
    half = sin(0.5 * sweep)
    s, lost = sin(sweep), 2.0 * half * half
    off_1 = end[axis_1] - start[axis_1] - (-s * y - lost * x)
    off_2 = end[axis_2] - start[axis_2] - (s * x - lost * y)
    total = (x * x + y * y) * sweep * sweep
    for i in range(6):
        if i != axis_1 and i != axis_2:
            total += square(end[i] - start[i])
    total = sqrt(total)
    f[LENGTH] = total
    f[RATIO] = programmed / total
    for i in range(6):
        f[SHAPE + i] = start[i]
        f[SHAPE + 6 + i] = (end[i] - start[i]) / total
        f[END + i] = end[i]
    f[SHAPE + 6 + axis_1], f[SHAPE + 6 + axis_2] = off_1 / total, off_2 / total
    f[SHAPE + 12], f[SHAPE + 13], f[SHAPE + 14] = x, y, sweep / total
    return sqrt(off_1 * off_1 + off_2 * off_2)


@tiered_kernel
def trim(f, kind, axis_1, axis_2, front, back, p, dp, ddp):
    """Shorten a line or an arc by `front` at its start and by `back` at its end."""
    if front > 0.0:
        evaluate(f, kind, axis_1, axis_2, front, p, dp, ddp)
        for i in range(6):
            f[SHAPE + i] = p[i]
        if kind == CIRCULAR:
            angle = f[SHAPE + 14] * front
            x, y, c, s = f[SHAPE + 12], f[SHAPE + 13], cos(angle), sin(angle)
            f[SHAPE + 12], f[SHAPE + 13] = c * x - s * y, s * x + c * y
        f[LENGTH] -= front
    if back > 0.0:
        f[LENGTH] -= back
        evaluate(f, kind, axis_1, axis_2, f[LENGTH], p, dp, ddp)
        for i in range(6):
            f[END + i] = p[i]


@tiered_kernel
def make_blend(f, half, p0, d0, dd0, p1, d1, dd1):
    """The quintic that leaves p0 and arrives at p1 with their derivatives, over q from 0 to 2·half, into the row f."""
    h = 2.0 * half
    h2 = h * h
    f[LENGTH] = h
    for i in range(6):
        way = p1[i] - p0[i] - h * d0[i] - 0.5 * h * h * dd0[i]
        tilt = h * (d1[i] - d0[i] - h * dd0[i])
        curl = h * h * (dd1[i] - dd0[i])
        c = SHAPE + i
        f[c], f[c + 6], f[c + 12] = p0[i], d0[i], 0.5 * dd0[i]
        f[c + 18] = (10.0 * way - 4.0 * tilt + 0.5 * curl) / (h * h2)
        f[c + 24] = (-15.0 * way + 7.0 * tilt - curl) / (h2 * h2)
        f[c + 30] = (6.0 * way - 3.0 * tilt + 0.5 * curl) / (h * (h2 * h2))
        f[END + i] = p1[i]


@tiered_kernel
def make_turn(first, second, half, corner, d0, d1):
    """From the direction d0 to d1 (unit vectors) about a corner of two lines, into two rows, each `half` long.

    The direction goes over from one to the other with a second derivative that is constant in each half, and of one
    size: of all ways within the same distance of the corner the one that is passed fastest within a jerk.
    """
    first[LENGTH] = second[LENGTH] = half
    for i in range(6):
        turn = d1[i] - d0[i]
        c = SHAPE + i
        for k in range(0, 36, 6):
            first[c + k] = second[c + k] = 0.0
        first[c], first[c + 6], first[c + 18] = corner[i] - half * d0[i], d0[i], turn / (6.0 * half * half)
        second[c], second[c + 6] = corner[i] + half / 6.0 * turn, 0.5 * (d0[i] + d1[i])
        second[c + 12], second[c + 18] = turn / (2.0 * half), -turn / (6.0 * half * half)
        first[END + i], second[END + i] = second[c], corner[i] + half * d1[i]


@tiered_kernel
def bound(f, kind, axis_1, axis_2, p, dp, ddp):
    """Fill in the bounds of the derivatives of the row f, and the derivatives at its ends."""
    length = f[LENGTH]
    evaluate(f, kind, axis_1, axis_2, 0.0, p, dp, ddp)
    for i in range(6):
        f[SLOPE_0 + i], f[BEND_0 + i] = dp[i], ddp[i]
    evaluate(f, kind, axis_1, axis_2, length, p, dp, ddp)
    for i in range(6):
        f[SLOPE_1 + i], f[BEND_1 + i] = dp[i], ddp[i]
    if kind == BLENDED:
        for i in range(6):
            _bound_polynomial(f, i, length)
        return
    for i in range(6):
        f[SLOPE + i] = fabs(f[SHAPE + 6 + i])
        f[BEND + i] = 0.0
        f[TWIST + i] = 0.0
    if kind == CIRCULAR:
        turn = fabs(f[SHAPE + 14])
        radius = sqrt(square(f[SHAPE + 12]) + square(f[SHAPE + 13]))
        for i in (axis_1, axis_2):
            f[SLOPE + i] += radius * turn
            f[BEND + i] = radius * (turn * turn)
            f[TWIST + i] = radius * (turn * (turn * turn))


@tiered_kernel
def _bound_polynomial(f, i, h):
    c = SHAPE + i
    c1, c2, c3, c4, c5 = f[c + 6], f[c + 12], f[c + 18], f[c + 24], f[c + 30]
    # d³p/dq³ = 6 c3 + 24 c4 q + 60 c5 q²: ends and vertex
    twist = max(fabs(6 * c3), fabs(6 * c3 + 24 * c4 * h + 60 * c5 * h * h))
    if c5 != 0.0:
        q = -c4 / (5.0 * c5)
        if 0.0 < q < h:
            twist = max(twist, fabs(6 * c3 + 24 * c4 * q + 60 * c5 * q * q))
    f[TWIST + i] = twist
    # d²p/dq²: ends, and where the third derivative is zero
    bend = max(fabs(2 * c2), fabs(2 * c2 + h * (6 * c3 + h * (12 * c4 + h * 20 * c5))))
    for sign in (-1.0, 1.0):
        q = -1.0
        if fabs(c5) * h > 1e-12 * fabs(c4):
            below = c4 * c4 - 2.5 * c3 * c5
            if below >= 0.0:
                q = (-c4 + sign * sqrt(below)) / (5.0 * c5)
        elif c4 != 0.0:
            q = -c3 / (4.0 * c4)
        if 0.0 < q < h:
            bend = max(bend, fabs(2 * c2 + q * (6 * c3 + q * (12 * c4 + q * 20 * c5))))
    f[BEND + i] = bend
    # dp/dq: the hull of its Bézier points (degree 4)
    slope = max(fabs(c1), fabs(c1 + h * (2 * c2 + h * (3 * c3 + h * (4 * c4 + h * 5 * c5)))))
    a1, a2, a3 = 2 * c2 * h, 3 * c3 * (h * h), 4 * c4 * (h * (h * h))
    slope = max(slope, fabs(c1 + a1 / 4), fabs(c1 + a1 / 2 + a2 / 6), fabs(c1 + 3 * a1 / 4 + a2 / 2 + a3 / 4))
    f[SLOPE + i] = slope


@tiered_kernel
def quickening(f):
    """How many times faster than at its ends a blend is passed at most, at a steady dq/dt; 1 or more.

    For X, Y, Z and for A, B, C, by the hull of the Bézier points of dp/dq, which are taken of its two halves.
    """
    h, worst = f[LENGTH], 1.0
    h2 = h * h
    left, right, row = np.empty((3, 5)), np.empty((3, 5)), np.empty(5)
    for first in (0, 3):
        ends = most = 0.0
        for i in range(3):
            c = SHAPE + first + i
            a0, a1, a2 = f[c + 6], 2.0 * f[c + 12] * h, 3.0 * f[c + 18] * h2
            a3, a4 = 4.0 * f[c + 24] * (h * h2), 5.0 * f[c + 30] * (h2 * h2)
            row[0], row[1], row[2] = a0, a0 + a1 / 4.0, a0 + a1 / 2.0 + a2 / 6.0
            row[3], row[4] = a0 + 0.75 * a1 + a2 / 2.0 + a3 / 4.0, a0 + a1 + a2 + a3 + a4
            for k in range(5):  # de Casteljau
                left[i, k], right[i, 4 - k] = row[0], row[4 - k]
                for m in range(4 - k):
                    row[m] = 0.5 * (row[m] + row[m + 1])
        for k in range(5):
            one = square(left[0, k]) + square(left[1, k]) + square(left[2, k])
            other = square(right[0, k]) + square(right[1, k]) + square(right[2, k])
            most = max(most, one, other)
            if k == 0:
                ends = one
            if k == 4:
                ends = max(ends, other)
        if ends > 0.0:
            worst = max(worst, sqrt(most / ends))
    return worst


def no_pieces() -> tuple[np.ndarray, np.ndarray]:
    """Arrays of no pieces."""
    return np.empty((0, FLOATS)), np.empty((0, INTS), dtype=np.int64)
