"""Corners of two lines passed faster than at one speed: what the averaged profile leaves there is taken.

The averaged profile (speed.py) passes a blend at an even speed and without acceleration along the path, since each of
its limits holds a ramp further to either side. But the axes that slow down for the corner and those that speed up
after it want the path to be slowed down and sped up there as well: with s the way, c the speed, a and j its
derivatives, an axis has the acceleration p′a + p″c² and the jerk p′j + 3p″ca + p‴c³, whose parts have opposite signs
on the way in and on the way out. So from the middle of the corner, passed at c without acceleration, each half of the
blend is passed in STEPS of constant jerk, as large as all axes allow; from its end the line is sped up along, within
its own acceleration and jerk, to a top that is held. Between two such corners the top is as high as the way allows.
What would not save time stays as it is.
"""

from __future__ import annotations

from math import fabs, inf, sqrt

import numpy as np

from rds.core.compiling import tiered_kernel
from rds.interpolators.motion.pieces import BLENDED, FEED, KIND, LENGTH, SHAPE, SLOPE_0, SLOPE_1, STRAIGHT
from rds.interpolators.motion.sampling import JERK, LASTS, PLACE, RATE, SINCE, SPEED, averaged

STEPS = 4  # of constant jerk, in which half a blend is passed
FORWARDS = np.array([0.5, 1.0])  # passes over the steps: each takes so much of the jerk that is left
BACKWARDS = np.array([1.0])
HALVINGS = 5
LOOKS = 2  # at a step, besides its start, while jerks are looked for; then 8 times as many
WITHIN = 0.998  # of acceleration and jerk that they may take there
LESS, FEWER = 0.97, 12  # what they are taken times, as often at most, where they take more in between
WORTH = 0.97  # of the speed before and after: a corner that is passed faster is left as it is
# What half a corner is: how long a step lasts, the jerks; speed and acceleration at its end, its length and highest
# speed; acceleration and jerk of the line; speed of the top, way from the middle until there, and how long that lasts.
STEP, JERKS, AT_END, PUSH_END, HALF, FASTEST, PUSH, LINE_JERK, TOP, RAMP, LASTING = 0, 1, 5, 6, 7, 8, 9, 10, 11, 12, 13
COLUMNS = 14


@tiered_kernel
def _keeps(axes, v0, row, looks, share):
    """Whether half a blend keeps all limits with the jerks in `row`; sets the length of its steps, and its end.

    axes: of each that moves, the direction in the middle, its whole change away from the middle, and one over velocity,
    acceleration and jerk. Of the two last there is `share`. looks: places of each step, besides its start, that are
    looked at.
    """
    s = v = a = 0.0
    for k in range(STEPS):
        j = row[JERKS + k]
        s, v, a = s + v + 0.5 * a + j / 6.0, v + a + 0.5 * j, a + j
    h, t = row[HALF], row[STEP]
    for _ in range(8):
        slope = v0 * STEPS + 3.0 * s * t * t
        if slope <= 0.0:
            break
        change = (v0 * STEPS * t + s * t * t * t - h) / slope
        t -= change
        if fabs(change) <= 1e-14 * fabs(t):
            break
    end_v, end_a = v0 + v * t * t, a * t
    if slope <= 0.0 or not t > 0.0 or end_v <= 0.0 or end_a < 0.0:
        return False
    if end_v + 0.5 * end_a * end_a / row[LINE_JERK] > row[TOP]:
        return False
    q, v, a, dt, per = 0.0, v0, 0.0, t / looks, 1.0 / h
    for k in range(STEPS):
        j = row[JERKS + k]
        for look in range(looks + 1):
            if look > 0:
                q += dt * (v + dt * (0.5 * a + dt * j / 6.0))
                v += dt * (a + 0.5 * dt * j)
                a += dt * j
            if v > row[FASTEST]:
                return False
            x = q * per
            bent, turned = x - 0.5 * x * x, (1.0 - x) * per * v
            twisted = 3.0 * turned * a - v * v * v * per * per
            turned *= v
            for i in range(len(axes)):
                d = axes[i, 1]
                slope = axes[i, 0] + d * bent
                if (
                    fabs(slope * j + d * twisted) * axes[i, 4] > share
                    or fabs(slope * a + d * turned) * axes[i, 3] > share
                    or fabs(slope) * v * axes[i, 2] > 1.0
                ):
                    return False
    row[STEP], row[AT_END], row[PUSH_END] = t, end_v, end_a
    return True


@tiered_kernel
def _ramp(row, top):
    """Duration and length of the ramp from the end of half a blend to `top`, where the acceleration is 0."""
    j, v, a = row[LINE_JERK], row[AT_END], row[PUSH_END]
    peak = min(row[PUSH], sqrt(max(j * (top - v) + 0.5 * a * a, a * a)))
    up = max(peak - a, 0.0) / j
    down = peak / j
    risen = v + (a + 0.5 * j * up) * up
    left = max(top - 0.5 * peak * down - risen, 0.0)
    even = left / peak if peak > 0.0 else 0.0
    way = up * (v + up * (0.5 * a + up * j / 6.0)) + even * (risen + 0.5 * left)
    way += down * (top - peak * down / 6.0)
    return up + even + down, way


@tiered_kernel
def _set_top(row, top):
    row[TOP] = top
    row[LASTING], row[RAMP] = _ramp(row, top)
    row[LASTING] += STEPS * row[STEP]
    row[RAMP] += row[HALF]


@tiered_kernel
def _raise_jerks(axes, v0, row, passes, first, by):
    """Raise the jerks of the steps, from `first` on, as far as the limits allow; whether any were found."""
    for share in passes:
        k = first
        while 0 <= k < STEPS:
            low, high = row[JERKS + k], row[JERKS + k] + 2.0 * row[LINE_JERK]
            before = low
            for _ in range(HALVINGS):
                row[JERKS + k] = 0.5 * (low + high)
                if _keeps(axes, v0, row, LOOKS, WITHIN):
                    low = row[JERKS + k]
                else:
                    high = row[JERKS + k]
            row[JERKS + k] = before + share * (low - before)
            k += by
    for _ in range(FEWER):
        if _keeps(axes, v0, row, 8 * LOOKS, 1.0):
            _set_top(row, row[TOP])
            return True
        row[JERKS : JERKS + STEPS] *= LESS
    return False


@tiered_kernel
def _pass_half(axes, v0, h, fastest, top, row):
    """The steps of half a blend from its middle, passed at v0, and the ramp to `top`; whether there are any.

    The jerks are raised one after the other, from the first to the last and the other way round: the better is taken.
    """
    push = most = inf
    for i in range(len(axes)):
        slope = fabs(axes[i, 0] + 0.5 * axes[i, 1])
        if slope > 1e-12:
            push, most = min(push, 1.0 / (axes[i, 3] * slope)), min(most, 1.0 / (axes[i, 4] * slope))
    row[HALF], row[FASTEST], row[TOP], row[PUSH], row[LINE_JERK] = h, fastest, top, push, most
    row[STEP], row[JERKS : JERKS + STEPS] = h / (v0 * STEPS), 0.0
    if not _keeps(axes, v0, row, LOOKS, WITHIN):
        return False
    other = row.copy()
    found = _raise_jerks(axes, v0, row, FORWARDS, 0, 1)
    if _raise_jerks(axes, v0, other, BACKWARDS, STEPS - 1, -1):
        if not found or top * (other[LASTING] - row[LASTING]) < other[RAMP] - row[RAMP]:
            row[:] = other
        found = True
    return found


@tiered_kernel
def flats(rows, tau, begin, end):
    """Where the averaged profile is even: rows of (time and place of its start, time and place of its end, speed)."""
    found = np.empty((len(rows), 5))
    count = i = 0
    while i < len(rows):
        if rows[i, RATE] != 0.0 or rows[i, SPEED] <= 0.0:
            i += 1
            continue
        k, v = i, rows[i, SPEED]
        while k + 1 < len(rows) and rows[k + 1, RATE] == 0.0 and rows[k + 1, SPEED] == v:
            k += 1
        since, until = rows[i, SINCE] + tau, rows[k, SINCE] + rows[k, LASTS]
        since, until = max(since, begin), min(max(since, until), end) if until >= since - 1e-9 * tau else -inf
        if until >= since:
            middle = rows[i, SINCE] + 0.5 * tau
            found[count, 0], found[count, 1] = since, rows[i, PLACE] + v * (since - middle)
            found[count, 2], found[count, 3] = until, rows[i, PLACE] + v * (until - middle)
            found[count, 4] = v
            count += 1
        i = k + 1
    return found[:count]


@tiered_kernel
def seam(rows, tau, begin, end):
    """The last time until `end` at which the averaged profile is at a top; `end` where it is at none."""
    even = flats(rows, tau, begin, end)
    for i in range(len(even) - 1, 0, -1):
        if even[i, 4] >= even[i - 1, 4]:
            return 0.5 * (even[i, 0] + even[i, 2])
    return end


@tiered_kernel
def _corner_at(place, f, u, at):
    """The first of the two halves of a blend between lines within which a place is, or −1."""
    k = np.searchsorted(at, place, side="right") - 1
    if k >= 1 and u[k, KIND] == BLENDED and u[k - 1, KIND] == BLENDED:
        k -= 1
    if k < 1 or k + 2 >= len(f) or u[k, KIND] != BLENDED or u[k + 1, KIND] != BLENDED:
        return -1
    if u[k - 1, KIND] != STRAIGHT or u[k + 2, KIND] != STRAIGHT or f[k, LENGTH] != f[k + 1, LENGTH]:
        return -1
    for i in range(6):
        if f[k, SHAPE + 12 + i] != 0.0 or f[k, SHAPE + 24 + i] != 0.0 or f[k + 1, SHAPE + 24 + i] != 0.0:
            return -1
    return k


@tiered_kernel
def _pass_corner(k, f, left, right, velocity, acceleration, jerk, one, other):
    """Both halves of the corner at the end of piece k, away from its middle, and the speed there; 0 if it is none."""
    axes, n = np.empty((6, 5)), 0
    h, fastest = f[k, LENGTH], f[k, FEED]
    v0 = fastest
    for i in range(6):
        m, d = f[k, SLOPE_1 + i], f[k + 1, SLOPE_1 + i] - f[k, SLOPE_0 + i]
        if fabs(m) < 1e-12 and fabs(d) < 1e-12:
            continue
        axes[n, 0], axes[n, 1] = m, d
        axes[n, 2], axes[n, 3], axes[n, 4] = 1.0 / velocity[i], 1.0 / acceleration[i], 1.0 / jerk[i]
        n += 1
        if fabs(m) > 1e-12:
            v0 = min(v0, velocity[i] / fabs(m))
        if fabs(d) > 1e-12:
            v0 = min(v0, sqrt(WITHIN * acceleration[i] * h / fabs(d)))
            v0 = min(v0, (WITHIN * jerk[i] * h * h / fabs(d)) ** (1.0 / 3.0))
    v0 *= 1.0 - 1e-9
    axes = axes[:n]
    if not _pass_half(axes, v0, h, fastest, right, other):
        return 0.0
    axes[:, 0] *= -1.0
    return v0 if _pass_half(axes, v0, h, fastest, left, one) else 0.0


@tiered_kernel
def _highest(one, other, way, most):
    """The highest top, at most `most`, on the line between two corners, with halves `one` and `other`, `way` apart."""
    low, high = max(one[TOP], other[TOP]), most
    room = way - one[HALF] - other[HALF]
    top = high
    while high - low > 1e-6 * high:
        if _ramp(one, top)[1] + _ramp(other, top)[1] <= room:
            low = top
        else:
            high = top
        top = 0.5 * (low + high)
    return low


@tiered_kernel
def _emit(out, count, since, lasts, place, speed, push, jerk):
    """One phase; the number of phases, and time, place, speed and acceleration at its end."""
    if lasts > 0.0:
        out[count, SINCE], out[count, LASTS], out[count, PLACE] = since, lasts, place
        out[count, SPEED], out[count, RATE], out[count, JERK] = speed, push, jerk
        count += 1
    place += lasts * (speed + lasts * (0.5 * push + lasts * jerk / 6.0))
    return count, since + lasts, place, speed + lasts * (push + 0.5 * lasts * jerk), push + lasts * jerk


@tiered_kernel
def _half(row, outwards, out, count, since, place, speed):
    """The phases of half a corner: from its middle to its top, or from there to the middle."""
    j, v, a = row[LINE_JERK], row[AT_END], row[PUSH_END]
    peak = min(row[PUSH], sqrt(max(j * (row[TOP] - v) + 0.5 * a * a, a * a)))
    up, down = max(peak - a, 0.0) / j, peak / j
    even = max(row[LASTING] - STEPS * row[STEP] - up - down, 0.0)
    push = 0.0
    if outwards:
        for k in range(STEPS):
            count, since, place, speed, push = _emit(out, count, since, row[STEP], place, speed, push, row[JERKS + k])
        count, since, place, speed, push = _emit(out, count, since, up, place, speed, push, j)
        count, since, place, speed, push = _emit(out, count, since, even, place, speed, push, 0.0)
        count, since, place, speed, push = _emit(out, count, since, down, place, speed, push, -j)
        return count, since
    count, since, place, speed, push = _emit(out, count, since, down, place, speed, push, -j)
    count, since, place, speed, push = _emit(out, count, since, even, place, speed, push, 0.0)
    count, since, place, speed, push = _emit(out, count, since, up, place, speed, push, j)
    for k in range(STEPS - 1, -1, -1):
        count, since, place, speed, push = _emit(out, count, since, row[STEP], place, speed, push, row[JERKS + k])
    return count, since


@tiered_kernel
def motion(rows, tau, begin, end, since, f, u, at, velocity, acceleration, jerk):
    """The motion from the time `begin` to `end` of the averaged profile, as phases of constant jerk from `since` on.

    rows: timed phases; f, u, at: pieces and the places of their starts. Corners are passed faster where that saves
    time. So the phases may end sooner than `end`, but at the same place, speed and acceleration.
    """
    even = flats(rows, tau, begin, end)
    n = len(even)
    corner, middle = np.full(n, -1), np.zeros(n)
    halves = np.zeros((n, 2, COLUMNS))
    for i in range(1, n - 1):
        top = min(even[i - 1, 4], even[i + 1, 4])
        if even[i, 4] >= WORTH * top:
            continue
        k = _corner_at(0.5 * (even[i, 1] + even[i, 3]), f, u, at)
        if k < 0 or even[i - 1, 3] < at[k - 1] or even[i + 1, 1] > at[k + 3]:
            continue
        one, other = halves[i, 0], halves[i, 1]
        v0 = _pass_corner(k, f, even[i - 1, 4], even[i + 1, 4], velocity, acceleration, jerk, one, other)
        if v0 == 0.0:
            continue
        left = at[k + 1] - 0.5 * (even[i - 1, 1] + even[i - 1, 3]) - one[RAMP]
        right = 0.5 * (even[i + 1, 1] + even[i + 1, 3]) - at[k + 1] - other[RAMP]
        lasts = one[LASTING] + other[LASTING] + left / even[i - 1, 4] + right / even[i + 1, 4]
        before = 0.5 * (even[i + 1, 0] + even[i + 1, 2] - even[i - 1, 0] - even[i - 1, 2])
        if left >= 0.0 and right >= 0.0 and lasts < before:
            corner[i], middle[i] = k, v0
    for i in range(1, n - 3):
        if corner[i] >= 0 and corner[i + 2] == corner[i] + 3:
            k = corner[i] + 2  # the line between two corners
            one, other = halves[i, 1], halves[i + 2, 0]
            most = f[k, FEED]
            for m in range(6):
                if fabs(f[k, SLOPE_0 + m]) > 1e-12:
                    most = min(most, velocity[m] / fabs(f[k, SLOPE_0 + m]))
            top = _highest(one, other, at[k + 2] - at[k - 1], max(most, even[i + 1, 4]))
            _set_top(one, top)
            _set_top(other, top)
    out = np.empty((3 * len(rows) + 2 * n * (STEPS + 6) + 8, 6))
    count, time = 0, begin
    for i in range(1, n - 1):
        if corner[i] < 0:
            continue
        k, one, other = corner[i], halves[i, 0], halves[i, 1]
        if i < 2 or corner[i - 2] < 0:  # else the corner before has come as far as the top between the two
            count, since = averaged(rows, tau, time, 0.5 * (even[i - 1, 0] + even[i - 1, 2]), since, out, count)
            place = 0.5 * (even[i - 1, 1] + even[i - 1, 3])
        else:
            place = at[corner[i - 2] + 1] + halves[i - 2, 1, RAMP]
        held = max(at[k + 1] - one[RAMP] - place, 0.0)
        count, since, place, _, _ = _emit(out, count, since, held / one[TOP], place, one[TOP], 0.0, 0.0)
        count, since = _half(one, False, out, count, since, place, one[TOP])
        count, since = _half(other, True, out, count, since, at[k + 1], middle[i])
        if i + 2 >= n or corner[i + 2] < 0:
            place = at[k + 1] + other[RAMP]
            held = max(0.5 * (even[i + 1, 1] + even[i + 1, 3]) - place, 0.0)
            count, since, _, _, _ = _emit(out, count, since, held / other[TOP], place, other[TOP], 0.0, 0.0)
        time = 0.5 * (even[i + 1, 0] + even[i + 1, 2])
    count, since = averaged(rows, tau, time, end, since, out, count)
    return out[:count], since
