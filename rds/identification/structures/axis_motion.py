"""The axis of a fit, solved exactly, with the derivative of its motion by every parameter.

    τ v' + (1 + b) v = K w(t) - F(v),      F(v) = F± (1 + s exp(-(v/v_s)²)),      F₊ for v > 0, F₋ for v < 0
    w = dead zone of (u(t - L) + u₀):      0 while |u + u₀| <= d, else d closer to 0

It sticks at rest while F₋(1+s) <= K w <= F₊(1+s). The output is the position behind a play of the whole width B. This
is the plain axis of mini-cnc-rds (equations 1 to 3) and the machine's own (`rds/models/machine_axis.py`, with the same
frozen Stribeck level over substeps).

Between the instants at which the voltage changes the response is closed-form. Its derivative is carried along: through
a zero crossing at the instant t* the state is continuous, and dt* = -(dv)/(v') follows from v(t*) = 0; at rest the
velocity depends on nothing. So the derivatives are exact to rounding, where differences of two runs would not be.

Only arithmetic on floats and arrays: numba compiles it as it stands, else it runs in Python.
"""

from __future__ import annotations

from math import ceil, exp, expm1, log1p

import numpy as np

from rds.core.compiling import kernel

# The parameters, as they stand in the array `p`.
TAU, K, PLUS, MINUS, VISCOUS, STRIBECK, STRIBECK_VELOCITY, OFFSET, DEAD_ZONE, DELAY, BACKLASH = range(11)
# The initial states: position behind the play, velocity, place in the play (-1 to 1); as columns after the parameters.
POSITION, VELOCITY, PLAY = range(11, 14)
COLUMNS = 14
SUBSTEP = 0.25e-3  # s, as rds.models.machine_motion.SUBSTEP
_SAME = 1e-12  # s: instants closer than this are one


@kernel
def _part(state, tangent, work, p, where, force, duration, stretch):
    """Move on by `duration` s at constant force, or until the velocity is zero; the time that is left.

    `state` = (position, velocity, output), `tangent` (3, n) its derivatives, `work` (4, n) scratch, row 3 the
    derivative of the force K w. `where` gives each column's parameter; `stretch` (n) is d(duration), updated.
    """
    n = len(where)
    x, v = state[0], state[1]
    tau, damped = p[TAU], 1.0 + p[VISCOUS]
    rate = damped / tau
    s, vs = p[STRIBECK], p[STRIBECK_VELOCITY]
    if v == 0.0 and p[MINUS] * (1.0 + s) <= force <= p[PLUS] * (1.0 + s):
        for i in range(n):
            tangent[1, i] = 0.0
        return 0.0
    forward = v > 0.0 or (v == 0.0 and force > 0.0)
    side = PLUS if forward else MINUS
    friction = p[side]
    # `final` is the velocity that it would end at, were the friction to stay as it is now
    final_by, rate_by = work[0], work[1]
    grown = 1.0
    if s > 0.0:
        e = exp(-((v / vs) ** 2))
        start = (force - friction * (1.0 + s * e)) / damped
        half = exp(-0.5 * rate * duration)
        middle = start + (v - start) * half
        held = middle * v < 0.0
        if held:
            middle = 0.0
        em = exp(-((middle / vs) ** 2))
        grown = 1.0 + s * em
    final = (force - friction * grown) / damped
    for i in range(n):
        kind = where[i]
        level = 0.0
        rate_by[i] = 0.0
        if kind == TAU:
            rate_by[i] = -rate / tau
        elif kind == side:
            level = grown
        elif kind == VISCOUS:
            rate_by[i] = 1.0 / tau
        if s > 0.0:
            if kind == STRIBECK:
                level = friction * em
            elif kind == STRIBECK_VELOCITY:
                level = friction * s * em * 2.0 * middle * middle / vs**3
            if not held:
                first = friction * s * e * (-2.0 * v / (vs * vs)) * tangent[1, i]
                if kind == side:
                    first += 1.0 + s * e
                elif kind == STRIBECK:
                    first += friction * e
                elif kind == STRIBECK_VELOCITY:
                    first += friction * s * e * 2.0 * v * v / vs**3
                start_by = (work[3, i] - first) / damped
                if kind == VISCOUS:
                    start_by -= start / damped
                half_by = -0.5 * half * (rate_by[i] * duration + rate * stretch[i])
                middle_by = start_by * (1.0 - half) + tangent[1, i] * half + (v - start) * half_by
                level += friction * s * em * (-2.0 * middle / (vs * vs)) * middle_by
        final_by[i] = (work[3, i] - level) / damped
        if kind == VISCOUS:
            final_by[i] -= final / damped
    crosses = False
    time = duration
    if final * v < 0.0:
        stop = log1p(-v / final) / rate
        if stop <= duration:
            crosses, time = True, stop
    passed = -expm1(-rate * time)  # 1 - e^(-rate t)
    decay = 1.0 - passed
    reach = passed / rate
    for i in range(n):
        longer = 0.0 if crosses else stretch[i]
        decay_by = -decay * (rate_by[i] * time + rate * longer)
        reach_by = -(decay_by + reach * rate_by[i]) / rate
        x_by = tangent[0, i] + final_by[i] * time + final * longer
        tangent[0, i] = x_by + (tangent[1, i] - final_by[i]) * reach + (v - final) * reach_by
        v_by = final_by[i] * passed + tangent[1, i] * decay + (v - final) * decay_by
        if crosses:  # v(t*) = 0 and v'(t*) = rate · final, so the instant moves by -v_by / v', and x does not with it
            stretch[i] += v_by / (rate * final)
            tangent[1, i] = 0.0
        else:
            stretch[i] = 0.0
            tangent[1, i] = v_by
    state[0] = x + final * time + (v - final) * reach
    state[1] = 0.0 if crosses else final + (v - final) * decay
    if p[BACKLASH] > 0.0:
        _take_along(state, tangent, p, where)
    return duration - time


@kernel
def _take_along(state, tangent, p, where):
    """The carriage follows the motor once the play is used up."""
    half = 0.5 * p[BACKLASH]
    if state[2] < state[0] - half:
        side = -1.0
    elif state[2] > state[0] + half:
        side = 1.0
    else:
        return
    state[2] = state[0] + side * half
    for i in range(len(where)):
        tangent[2, i] = tangent[0, i]
        if where[i] == BACKLASH:
            tangent[2, i] += 0.5 * side


@kernel
def _driven(u, offset, dead):
    """w for the voltage `u`, and its derivatives by the offset (0 or 1) and by the dead zone (0, 1 or -1)."""
    w = u + offset
    if dead > 0.0:
        if w > dead:
            return w - dead, 1.0, -1.0
        if w < -dead:
            return w + dead, 1.0, 1.0
        return 0.0, 0.0, 0.0
    return w, 1.0, 0.0


@kernel
def _change_at_sample(state, tangent, p, where, before, after):
    """The voltage changes at the very instant of a sample: with a little more delay, the old one acts on after it."""
    for i in range(len(where)):
        if where[i] == DELAY:
            tangent[1, i] += _acceleration(state[1], p[K] * _driven(before, p[OFFSET], p[DEAD_ZONE])[0], p)
            tangent[1, i] -= _acceleration(state[1], p[K] * _driven(after, p[OFFSET], p[DEAD_ZONE])[0], p)


@kernel
def _acceleration(v, force, p):
    """v', mm/s²; 0 where the axis sticks."""
    s = p[STRIBECK]
    if v == 0.0 and p[MINUS] * (1.0 + s) <= force <= p[PLUS] * (1.0 + s):
        return 0.0
    friction = p[PLUS] if v > 0.0 or (v == 0.0 and force > 0.0) else p[MINUS]
    if s > 0.0:
        friction *= 1.0 + s * exp(-((v / p[STRIBECK_VELOCITY]) ** 2))
    return (force - friction - (1.0 + p[VISCOUS]) * v) / p[TAU]


@kernel
def _begin(x0, p, where, state, tangent):
    """The initial state: position behind the play (mm), velocity (mm/s), place of the motor in the play (-1 to 1)."""
    half = 0.5 * p[BACKLASH]
    state[0], state[1], state[2] = x0[0] + x0[2] * half, x0[1], x0[0]
    for i in range(len(where)):
        tangent[0, i] = tangent[1, i] = tangent[2, i] = 0.0
        if where[i] == POSITION:
            tangent[0, i] = tangent[2, i] = 1.0
        elif where[i] == VELOCITY:
            tangent[1, i] = 1.0
        elif where[i] == PLAY:
            tangent[0, i] = half
        elif where[i] == BACKLASH:
            tangent[0, i] = 0.5 * x0[2]


@kernel
def move(t, u, x0, p, where, y, by, rate_out):
    """Fill `y` (N) with the output at the times `t` (N), and `by` (N, n) with its derivatives by the columns `where`.

    The output is the position; with `rate_out` the velocity.

    `u` (N), V, is held from each time to the next, and acts p[DELAY] later; before the first command has arrived, it
    is taken to have been there already. With an empty `where`, `by` is not touched.
    """
    n = len(where)
    state, tangent = np.zeros(3), np.zeros((3, n))
    work, stretch = np.zeros((4, n)), np.zeros(n)
    _begin(x0, p, where, state, tangent)
    plain = p[STRIBECK] == 0.0 and p[BACKLASH] == 0.0
    gain, offset, dead, delay = p[K], p[OFFSET], p[DEAD_ZONE], p[DELAY]
    damped = 1.0 + p[VISCOUS]
    rate = damped / p[TAU]
    force_by = work[3]
    # which columns are these parameters'; of offset and dead zone, times the gain
    columns = np.zeros((7, n))
    of_side, of_viscous, of_delay = columns[:2], columns[2], columns[3]
    of_gain, of_offset, of_dead = columns[4], columns[5], columns[6]
    for i in range(n):
        of_gain[i] = 1.0 if where[i] == K else 0.0
        of_offset[i] = gain if where[i] == OFFSET else 0.0
        of_dead[i] = gain if where[i] == DEAD_ZONE else 0.0
        of_side[0, i] = 1.0 if where[i] == PLUS else 0.0
        of_side[1, i] = 1.0 if where[i] == MINUS else 0.0
        of_viscous[i] = 1.0 if where[i] == VISCOUS else 0.0
        of_delay[i] = 1.0 if where[i] == DELAY else 0.0
    delayed = of_delay.any()
    # of the last parts, before and after a change; what the rate of decay makes of x and v, and a column by the rate
    parts, gaps = np.zeros((3, 2)), np.zeros((4, n))
    periods, decays, reaches = parts[0], parts[1], parts[2]
    x_by_gap, v_by_gap = gaps[:2], gaps[2:]
    periods[:] = -1.0
    acting = 0  # the command that acts now
    out = 1 if rate_out else 2 if p[BACKLASH] > 0.0 else 0
    for k in range(len(t)):
        y[k] = state[out]
        for i in range(n):
            by[k, i] = tangent[out, i]
        if k + 1 == len(t):
            break
        now, until = t[k], t[k + 1]
        moved = False  # whether `now` is an instant that moves with the delay
        while now < until:
            before = acting
            while acting + 1 < len(t) and t[acting + 1] + delay <= now + _SAME:
                acting += 1
            if delayed and acting > before and not moved:
                _change_at_sample(state, tangent, p, where, u[before], u[acting])
            end, moves = until, False
            if acting + 1 < len(t) and t[acting + 1] + delay < until - _SAME:
                end, moves = t[acting + 1] + delay, True
            w, slope, narrower = _driven(u[acting], offset, dead)
            force = gain * w
            for i in range(n):
                force_by[i] = of_gain[i] * w + of_offset[i] * slope + of_dead[i] * narrower
            v = state[1]
            side = PLUS if v > 0.0 or (v == 0.0 and force > 0.0) else MINUS
            final = (force - p[side]) / damped
            if plain and v != 0.0 and final * v > 0.0:
                # the usual part of a sample: no crossing, and the same duration as this part had before
                time = end - now
                part = 1 if moved else 0
                if abs(time - periods[part]) > _SAME:
                    periods[part] = time
                    decays[part] = exp(-rate * time)
                    reaches[part] = -expm1(-rate * time) / rate
                    for i in range(n):
                        rate_by = 1.0 / p[TAU] if where[i] == VISCOUS else -rate / p[TAU] if where[i] == TAU else 0.0
                        v_by_gap[part, i] = -decays[part] * rate_by * time
                        x_by_gap[part, i] = -(v_by_gap[part, i] + reaches[part] * rate_by) / rate
                decay, reach, gap = decays[part], reaches[part], v - final
                longer = (1.0 if moves else 0.0) - (1.0 if moved else 0.0)  # d(time) by the delay
                state[0] += final * time + gap * reach
                state[1] = final + gap * decay
                x_later, v_later = state[1] * longer, -gap * decay * rate * longer
                row = 0 if side == PLUS else 1
                for i in range(n):
                    final_by = (force_by[i] - of_side[row, i] - final * of_viscous[i]) / damped
                    apart = tangent[1, i] - final_by
                    tangent[0, i] += final_by * time + apart * reach + gap * x_by_gap[part, i] + x_later * of_delay[i]
                    tangent[1, i] = final_by + apart * decay + gap * v_by_gap[part, i] + v_later * of_delay[i]
            else:
                steps = 1
                if p[STRIBECK] > 0.0:
                    steps = max(ceil((end - now) / SUBSTEP - 1e-9), 1)
                for _ in range(steps):
                    for i in range(n):
                        stretch[i] = 0.0
                        if where[i] == DELAY:
                            stretch[i] = ((1.0 if moves else 0.0) - (1.0 if moved else 0.0)) / steps
                    left = (end - now) / steps
                    while left > 0.0:
                        left = _part(state, tangent, work, p, where, force, left, stretch)
            now, moved = end, moves


@kernel
def extra_voltages(t, u, firsts, block, x0, ends, p, rate_out, trial, rounds, far, found):
    """Fill `found` (m) with the constant extra voltage of each block with which it ends at `ends` (m); NaN for none.

    Blocks of `block` samples begin at the samples `firsts` (m), in the states `x0` (m, 3). By the secant method from
    the voltages 0 and `trial`, `rounds` at most; none that is beyond `far`.
    """
    none = np.zeros(0, dtype=np.int64)
    by, y, command = np.zeros((block + 1, 0)), np.zeros(block + 1), np.zeros(block + 1)
    for number in range(len(firsts)):
        first = firsts[number]
        times = t[first : first + block + 1]
        found[number] = np.nan
        a, b, at_a, at_b = 0.0, trial, 0.0, 0.0
        for turn in range(-2, rounds):
            if turn >= 0:
                if not (np.isfinite(at_a) and np.isfinite(at_b)) or at_a == at_b:
                    break
                a, at_a, b = b, at_b, b - at_b * (b - a) / (at_b - at_a)
                if abs(b) > far:
                    break
                if abs(b - a) <= 1e-6 * trial:
                    found[number] = b
                    break
            extra = a if turn == -2 else b
            for k in range(block + 1):
                command[k] = u[first + k] + extra
            move(times, command, x0[number], p, none, y, by, rate_out)
            miss = y[block] - ends[number]
            if turn == -2:
                at_a = miss
            else:
                at_b = miss
            if turn == rounds - 1 and abs(at_b) <= 1e-3 * abs(ends[number] - x0[number, 1 if rate_out else 0]):
                found[number] = b
