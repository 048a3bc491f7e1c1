"""The motion of the machine's own axis over a time of constant voltage, on floats alone, as numba compiles it.

The equations and what is exact in them are those of `rds.models.machine_axis`.
"""

from __future__ import annotations

from math import ceil, exp, expm1, inf, log1p

# 1/40 of the shortest time constant here (10 ms). Against substeps of 1 µs the position differs by less than 1e-6 mm
# (a thousandth of an encoder count) over several reversals; a module's four substeps per ms cost 4 µs.
SUBSTEP = 0.25e-3  # s


def pull_of(u, K, offset, dead_zone):
    """K w (mm/s): what the voltage `u` (V) pulls with, w being u + `offset` brought closer to 0 by `dead_zone` (V)."""
    w = u + offset
    if dead_zone > 0.0:
        if w > dead_zone:
            w -= dead_zone
        elif w < -dead_zone:
            w += dead_zone
        else:
            w = 0.0
    return K * w


def moved(position, velocity, carriage, pull, time, tau, damping, plus, minus, stribeck, slow, half_play, back):
    """Position (mm, of the motor), velocity (mm/s) and carriage (mm, behind the play) `time` s later.

    `pull` (mm/s) is constant over that time. `damping` = 1 + viscous; `plus` and `minus` are Coulomb friction
    (mm/s), `stribeck` what it grows by at standstill, as a share, and `slow` (mm/s) the velocity at which that has
    gone; `half_play` (mm) is half the backlash; `back` is what `damping` is more while the axis moves backward.
    """
    if time <= 0.0:
        return position, velocity, carriage
    low, high = minus * (1.0 + stribeck), plus * (1.0 + stribeck)
    steps = max(ceil(time / SUBSTEP - 1e-9), 1) if stribeck > 0.0 else 1
    step = time / steps
    for _ in range(steps):
        left = step
        while left > 0.0:
            if velocity == 0.0 and low <= pull <= high:
                return position, velocity, carriage  # and stays so as long as the voltage does
            forward = velocity > 0.0 or (velocity == 0.0 and pull > 0.0)
            friction = plus if forward else minus
            damped = damping if forward else damping + back
            rate = damped / tau
            level = friction
            if stribeck > 0.0:  # its level is frozen at the speed predicted for the middle
                share = velocity / slow
                level = friction * (1.0 + stribeck * exp(-share * share))
                final = (pull - level) / damped
                middle = final + (velocity - final) * exp(-0.5 * rate * left)
                share = middle / slow if middle * velocity >= 0.0 else 0.0
                level = friction * (1.0 + stribeck * exp(-share * share))
            final = (pull - level) / damped
            # the velocity is zero where (v - final) exp(-rate t) = -final
            crossing = log1p(-velocity / final) / rate if final * velocity < 0.0 else inf
            part = min(left, crossing)
            passed = -expm1(-rate * part)
            position += final * part + (velocity - final) * passed / rate
            carriage = min(max(carriage, position - half_play), position + half_play)
            velocity = 0.0 if crossing <= left else velocity + (final - velocity) * passed
            left -= part
    return position, velocity, carriage
