"""From the programmed path to pieces: lines that are nearly one are joined, corners blended or stopped at.

A corner between two segments in mode BLEND is cut by a curve that leaves the one and reaches the other with their
position, tangent and curvature, at most the tolerance away from the path. For two lines that meet at unit tangents t₀
and t₁ and a curve from −d to d, its derivative goes over from t₀ to t₁ as 2x² and then 1 − 2(1 − x)²: the jerk of each
axis has one size all along, as in the fastest change of speed. It passes the corner in d/6 |t₁ − t₀|, and is d/6 sin θ
from the lines at most, θ being the turn. Where one of the two is an arc, the curve is a quintic polynomial. Lines are
joined within Q of G64 as far as that leaves half of P, and corners get what joining left over: so the motion is off the
path by P at most, or by Q where that is more.
"""

from __future__ import annotations

from math import fabs, inf, sqrt
from typing import Any

import numpy as np

from rds.core.compiling import tiered_kernel
from rds.interpolators.motion.pieces import (
    AXIS_1,
    AXIS_2,
    BEND,
    BENDING,
    BLENDED,
    CIRCULAR,
    DISTANCE,
    FEED,
    FIRST,
    FLOATS,
    INTS,
    KIND,
    LAST,
    LENGTH,
    RATIO,
    REST,
    SHARE,
    STRAIGHT,
    TWIST,
    bound,
    evaluate,
    make_blend,
    make_circular,
    make_straight,
    make_turn,
    quickening,
    square,
    trim,
)

TINY = 1e-6  # mm or degrees: what is shorter is taken together with what follows
SHARP = -0.866  # cosine of the turn (150°) from which a corner in mode BLEND is stopped at, not cut
MOST_JOINED = 64  # lines
TURN_SHARE = 0.3  # of the jerk, for changes of direction at joints on an exact path
STOP_SHARE = 0.05  # of the feed: where a joint allows less, stopping costs no more time
UNSURE = 1.06  # times the estimate: 0.1 % of random plans take longer than stopping everywhere, without it 0.9 %
LOST = 0.65  # at most, at turns of 40° to 145° on machines whose acceleration limits c: 0.25 to 0.66
EXACT_STOP, BLEND, LINE = 1, 2, -1  # as in segments.py


@tiered_kernel
def _size(x, y, z):
    return sqrt(x * x + y * y + z * z)


@tiered_kernel
def gap(a, b):
    """Distance of two positions: the larger of that in X, Y, Z (mm) and that in A, B, C (degrees)."""
    linear = _size(a[0] - b[0], a[1] - b[1], a[2] - b[2])
    rotary = _size(a[3] - b[3], a[4] - b[4], a[5] - b[5])
    return max(linear, rotary)


@tiered_kernel
def _off_line(begin, ends, first, last, nearest):
    """How far the ends first to last−1 are from the line from `begin` to ends[last]; inf if not in order along it."""
    total = 0.0
    for i in range(6):
        total += square(ends[last, i] - begin[i])
    if total == 0.0:
        return inf
    before, off = 0.0, 0.0
    for k in range(first, last):
        along = 0.0
        for i in range(6):
            along += (ends[k, i] - begin[i]) * (ends[last, i] - begin[i])
        along /= total
        if along < before or along > 1.0:
            return inf
        before = along
        for i in range(6):
            nearest[i] = begin[i] + along * (ends[last, i] - begin[i])
        off = max(off, gap(ends[k], nearest))
    return off


@tiered_kernel
def _away(b, f, u, q, p, dp, ddp):
    """Distance of b to the piece f near its parameter q: Newton's steps to the nearest point."""
    for _ in range(3):
        evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], q, p, dp, ddp)
        along = size = 0.0
        for i in range(6):
            along += (b[i] - p[i]) * dp[i]
            size += dp[i] * dp[i]
        q = min(max(q + along / size, 0.0), f[LENGTH]) if size > 0.0 else q
    evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], q, p, dp, ddp)
    return gap(b, p)


@tiered_kernel
def _blend_half(f, u, g, w, tolerance, work):
    """Half the length in q of the blend from piece f to piece g (untrimmed); 0 where none fits.

    Between two lines it is left in work[0] and work[11], else in work[0] alone.
    """
    p0, d0, dd0, p1, d1, dd1 = work[1, :6], work[2, :6], work[3, :6], work[4, :6], work[5, :6], work[6, :6]
    p, dp, ddp, b = work[7, :6], work[8, :6], work[9, :6], work[10, :6]
    evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], f[LENGTH], p0, d0, dd0)
    evaluate(g, w[KIND], w[AXIS_1], w[AXIS_2], 0.0, p1, d1, dd1)
    turn = bend = product = 0.0
    for i in range(6):
        turn += square(d1[i] - d0[i])
        bend += square(dd1[i] - dd0[i])
        product += d0[i] * d1[i]
    turn, bend = sqrt(turn), sqrt(bend)
    half = 0.5 * min(f[LENGTH], g[LENGTH])
    if turn < 1e-12 and bend < 1e-12:
        return 0.0
    sine = sqrt(max(1.0 - product * product, 0.0))
    if sine > 0.0:
        half = min(half, 6.0 * 0.999 * tolerance / sine)
    if u[KIND] == STRAIGHT and w[KIND] == STRAIGHT:
        if half < 10.0 * TINY:
            return 0.0
        make_turn(work[0], work[11], half, p1, d0, d1)
        return half
    for _ in range(60):
        if half < 10.0 * TINY:
            return 0.0
        evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], f[LENGTH] - half, p0, d0, dd0)
        evaluate(g, w[KIND], w[AXIS_1], w[AXIS_2], half, p1, d1, dd1)
        make_blend(work[0], half, p0, d0, dd0, p1, d1, dd1)
        worst = 0.0
        for k in range(1, 32):
            q = k * half / 16.0
            evaluate(work[0], BLENDED, 0, 1, q, b, dp, ddp)
            near = _away(b, f, u, min(f[LENGTH] - half + q, f[LENGTH]), p, dp, ddp)
            if near > worst:
                worst = max(worst, min(near, _away(b, g, w, max(q - half, 0.0), p, dp, ddp)))
        if worst <= 0.97 * tolerance:  # between the 31 places it is not 3 % more
            return half
        half *= max(0.3, min(0.8, 0.95 * tolerance / worst))
    return 0.0


@tiered_kernel
def _turn_speed(f, g, jerk, T):
    """dq/dt at which the change of direction from f to g takes TURN_SHARE of the jerk of a sample's differences."""
    speed = inf
    for i in range(6):
        turn = fabs(g[i] - f[i])
        if turn > 0.0:
            speed = min(speed, TURN_SHARE * jerk[i] * T * T / turn)
    return speed


@tiered_kernel
def _stopping_is_faster(b, f, g, d0, d1, acceleration, jerk, tau, work):
    """Whether a rest at the corner of pieces f and g takes less time than the blend b, as far as both can be told here.

    With v the speed before and after it, a the acceleration along the lines, c the speed in the blend of length h and
    r = min(τ, √(v/j)) the ramp of the acceleration, passing costs (v − c)²/(v a) + (r + s h/c)(1 − c/v), resting
    v/a + r. The share s is what is lost in the blend of what an even speed in it would lose (corners.py).
    """
    bound(b, BLENDED, 0, 1, work[8, :6], work[9, :6], work[10, :6])
    a = j = inf
    c = b[FEED]
    for i in range(6):
        along = max(fabs(d0[i]), fabs(d1[i]))
        if along > 0.0:
            a, j = min(a, acceleration[i] / along), min(j, jerk[i] / along)
        if b[BEND + i] > 0.0:
            c = min(c, sqrt(acceleration[i] / b[BEND + i]))
        if b[TWIST + i] > 0.0:
            c = min(c, (jerk[i] / b[TWIST + i]) ** (1.0 / 3.0))
    v = min(min(f[FEED], g[FEED]), sqrt(a * min(f[LENGTH], g[LENGTH])))
    if c >= v:
        return False
    ramp = min(tau, sqrt(v / j))
    length = 2.0 * b[LENGTH]  # of both halves
    passing = square(v - c) / (v * a) + (ramp + LOST * length / c) * (1.0 - c / v)
    return UNSURE * passing > v / a + ramp


@tiered_kernel
def _emit(out, ints, count, f, u, first, last, rest, distance, work):
    p, dp, ddp = work[8, :6], work[9, :6], work[10, :6]
    out[count, :] = f[:FLOATS]
    ints[count, :] = u[:INTS]
    ints[count, FIRST], ints[count, LAST], ints[count, REST] = first, last, rest
    out[count, DISTANCE], out[count, SHARE] = distance, BENDING
    bound(out[count], u[KIND], u[AXIS_1], u[AXIS_2], p, dp, ddp)
    return count + 1


@tiered_kernel
def _close(out, ints, count, f, u, first, last, front, distance, work):
    """Emit a piece, less what a blend took of its start, that ends at rest."""
    taken = distance + front * f[RATIO]
    trim(f, u[KIND], u[AXIS_1], u[AXIS_2], front, 0.0, work[6, :6], work[7, :6], work[8, :6])
    return _emit(out, ints, count, f, u, first, last, np.int64(1), taken, work)


@tiered_kernel
def build(
    start,
    end,
    centre,
    plane,
    sweep,
    length,
    rate,
    mode,
    tolerance,
    collinear,
    rest,
    point,
    final,
    state,
    acceleration,
    jerk,
    tau,
    T,
):
    """Pieces of the segments given as columns: (floats, whole numbers, segments that are done with).

    rate: inf for rapids. tolerance: that of blending, no more inf. rest: whether the motion rests after the segment.
    point (6): where the first segment really begins. state: [length of the first piece already taken by a blend,
    programmed distance of the first segment's start]; both are brought up to date for the next call, which begins with
    the first segment that is not done with. final: nothing follows.
    """
    n = len(rate)
    out, ints = np.empty((3 * n + 1, FLOATS)), np.zeros((3 * n + 1, INTS), np.int64)
    rows, kinds = np.zeros((2, FLOATS)), np.zeros((2, INTS), np.int64)
    work = np.zeros((12, FLOATS))
    blend = np.zeros(INTS, np.int64)
    blend[KIND] = BLENDED
    zero: Any = np.int64(0)  # not the literal, for each of which numba would compile what is called with it
    count = done = i = zero
    front, distance = state[0], state[1]
    held, old, held_first, held_last, held_room = False, 0, zero, zero, 0.0
    here = point.copy()
    begin = point.copy()  # where the held piece begins
    while i < n:
        first = i
        # what belongs together: a tiny way with what follows, lines that are one
        while i + 1 < n and not rest[i] and gap(here, end[i]) < TINY and plane[i] == LINE:
            i += 1
        last, off = i, 0.0
        if plane[last] == LINE and mode[last] == BLEND and collinear[last] > 0.0 and rate[last] < inf:
            most = max(tolerance[last], collinear[last])
            within = min(collinear[last], most - 0.5 * tolerance[last])  # half is left for the corners
            joinable = True
            while joinable and last + 1 < n and last + 1 - first < MOST_JOINED and not rest[last]:
                k = last + 1
                joinable = plane[k] == LINE and mode[k] == BLEND and rate[k] == rate[last]
                joinable = joinable and collinear[k] == collinear[last] and tolerance[k] == tolerance[last]
                away = _off_line(here, end, first, k, work[1]) if joinable else inf
                joinable = joinable and away <= within
                if joinable:
                    last, off = k, away
            if joinable and last + 1 == n and not final and not rest[last] and n - first < MOST_JOINED:
                break  # it may go on
        room = min(tolerance[last], max(tolerance[last], collinear[last]) - off)
        programmed = 0.0
        for k in range(first, last + 1):
            programmed += length[k]
        closes = rest[last] or (final and last + 1 == n)
        if plane[last] == LINE and gap(here, end[last]) < TINY and not closes:
            break  # nothing yet; it is taken with what follows
        if plane[last] == LINE and gap(here, end[last]) < TINY * TINY:
            if held:  # no way at all, but a rest: it ends what is held
                programmed += rows[old, LENGTH] * rows[old, RATIO]
                count = _close(out, ints, count, rows[old], kinds[old], held_first, last, front, distance, work)
            front, held, i, done = 0.0, False, last + 1, last + 1
            distance += programmed
            begin[:] = here
            continue
        new = 1 - old
        f, u = rows[new], kinds[new]
        drift = 0.0
        if plane[last] == LINE:
            u[KIND] = STRAIGHT
            make_straight(f, here, end[last], programmed)
        else:
            u[KIND] = CIRCULAR
            u[AXIS_1], u[AXIS_2] = plane[last], (plane[last] + 1) % 3
            if plane[last] == 1:
                u[AXIS_1], u[AXIS_2] = 2, 0
            elif plane[last] == 2:
                u[AXIS_1], u[AXIS_2] = 1, 2
            drift = make_circular(f, here, end[last], centre[last], sweep[last], u[AXIS_1], u[AXIS_2], programmed)
        f[FEED] = rate[last] * programmed / (f[RATIO] * (programmed + drift)) if f[RATIO] > 0.0 else rate[last]
        if held:
            g, w = rows[old], kinds[old]
            stops, half = mode[held_last] == EXACT_STOP, 0.0
            p0, d0, p1, d1, dd = work[1, :6], work[2, :6], work[3, :6], work[4, :6], work[5, :6]
            evaluate(g, w[KIND], w[AXIS_1], w[AXIS_2], g[LENGTH], p0, d0, dd)
            evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], 0.0, p1, d1, dd)
            if not stops and mode[held_last] == BLEND and mode[last] == BLEND:
                cosine, size_0, size_1 = 0.0, 0.0, 0.0
                for k in range(6):
                    cosine += d0[k] * d1[k]
                    size_0 += square(d0[k])
                    size_1 += square(d1[k])
                stops = cosine < SHARP * sqrt(size_0 * size_1)
                left = min(held_room, room)
                if not stops and left > 0.0:
                    half = _blend_half(g, w, f, u, left, work)
                if half > 0.0 and u[KIND] == STRAIGHT and w[KIND] == STRAIGHT:
                    work[0, FEED] = min(g[FEED], f[FEED])
                    evaluate(g, w[KIND], w[AXIS_1], w[AXIS_2], g[LENGTH], p0, d0, dd)
                    evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], 0.0, p1, d1, dd)
                    if _stopping_is_faster(work[0], g, f, d0, d1, acceleration, jerk, tau, work):
                        stops, half = True, 0.0
            if not stops and half == 0.0:
                evaluate(g, w[KIND], w[AXIS_1], w[AXIS_2], g[LENGTH], p0, d0, dd)
                evaluate(f, u[KIND], u[AXIS_1], u[AXIS_2], 0.0, p1, d1, dd)
                stops = _turn_speed(d0, d1, jerk, T) < STOP_SHARE * min(g[FEED], f[FEED], state[2])
            size, ratio, feed = g[LENGTH], g[RATIO], g[FEED]
            if size - front - half > 1e-12:
                taken = distance + front * ratio
                trim(g, w[KIND], w[AXIS_1], w[AXIS_2], front, half, work[6, :6], work[7, :6], work[8, :6])
                count = _emit(out, ints, count, g, w, held_first, held_last, np.int64(stops), taken, work)
            if half > 0.0:
                b, taken = work[0], distance + (size - half) * ratio
                if u[KIND] == STRAIGHT and w[KIND] == STRAIGHT:  # in two halves
                    after = work[11]
                    b[RATIO], b[FEED] = ratio, min(feed, f[FEED])
                    after[RATIO], after[FEED] = f[RATIO], b[FEED]
                    count = _emit(out, ints, count, b, blend, held_first, last, zero, taken, work)
                    taken = distance + size * ratio
                    count = _emit(out, ints, count, after, blend, held_first, last, zero, taken, work)
                else:
                    b[RATIO], b[FEED] = 0.5 * (ratio + f[RATIO]), min(feed, f[FEED]) / quickening(b)
                    count = _emit(out, ints, count, b, blend, held_first, last, zero, taken, work)
            front = half
            distance += size * ratio
        done, held, held_first, held_last, held_room, old = first, True, first, last, room, new
        begin[:] = here
        here[:] = end[last]
        i = last + 1
        if closes:
            count = _close(out, ints, count, f, u, first, last, front, distance, work)
            front, held, done = 0.0, False, i
            distance += programmed
            begin[:] = here
    state[0], state[1] = front, distance
    point[:] = begin
    return out[:count], ints[:count], done
