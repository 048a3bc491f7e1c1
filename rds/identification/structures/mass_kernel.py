"""An axis whose friction differs by direction in both its parts, solved exactly, with exact sensitivities.

    v > 0:  v' = b u - c₊ - r₊ v
    v < 0:  v' = b u + c₋ - r₋ v,      at rest the axis stays while -c₋ <= b u <= c₊

Over a time h of constant voltage and direction, with p what stands before the last term,

    v(h) = v e^(-r h) + p φ₁,    x(h) = x + v φ₁ + p φ₂,    φ₁ = (1 - e^(-r h)) / r,    φ₂ = (h - φ₁) / r,

which holds for r = 0 as well (series). The velocity reaches zero at s = log(1 - r v/p) / r; what comes after depends on
the parameters through s too, and ds = -dv(s)/p. The columns of sensitivities are b, c₊, c₋, r₊, r₋ and the initial
position and velocity. Units: mm, s, V.
"""

from __future__ import annotations

from math import exp, log1p

import numpy as np

from rds.core.compiling import kernel

COLUMNS = 7


@kernel
def _phi(r, h):
    """e^(-r h), φ₁, φ₂ and the derivatives of φ₁ and φ₂ by r."""
    z = r * h
    if abs(z) > 0.05:
        decay = exp(-z)
        one = (1.0 - decay) / r
        two = (h - one) / r
        one_r = (h * decay - one) / r
        return decay, one, two, one_r, (-one_r - two) / r
    one, two, one_r, two_r = 0.0, 0.0, 0.0, 0.0
    term, factor = 1.0, 1.0  # (-z)^k and (k + 1)!
    for k in range(9):
        factor *= k + 1
        one += term / factor
        two += term / (factor * (k + 2))
        one_r += term * (k + 1) / (factor * (k + 2))
        two_r += term * (k + 1) / (factor * (k + 2) * (k + 3))
        term *= -z
    return 1.0 - z * one, h * one, h * h * two, -h * h * one_r, -h * h * h * two_r


@kernel
def _stop(v, p, r, h):
    """When the velocity v > 0 > p (or the reverse) reaches zero, s, or -1.0 if not within h."""
    ratio = -v / p
    s = log1p(r * ratio) / r if abs(r * ratio) > 1e-9 else ratio
    return s if s <= h else -1.0


@kernel
def _direction(v, force, plus, minus):
    """+1 or -1: which way the axis moves, or begins to; 0: it stays at rest. `force` is b u."""
    if v > 0.0 or (v == 0.0 and force > plus):
        return 1
    if v < 0.0 or force < -minus:
        return -1
    return 0


@kernel
def positions(t, u, x, v, b, plus, minus, r_plus, r_minus, rate=False):
    """The position at each of the times `t`, of commands `u` held from each to the next; with `rate` the velocity."""
    out = np.empty(len(t))
    for k in range(len(t)):
        out[k] = v if rate else x
        if k + 1 == len(t):
            break
        left, force = t[k + 1] - t[k], b * u[k]
        for _ in range(2):  # at most one crossing
            way = _direction(v, force, plus, minus)
            if way == 0:
                break
            p, r = (force - plus, r_plus) if way > 0 else (force + minus, r_minus)
            s = _stop(v, p, r, left) if v * p < 0.0 else -1.0
            _, one, two, _, _ = _phi(r, s if s >= 0.0 else left)
            x += v * one + p * two
            if s < 0.0:
                v += (p - r * v) * one
                break
            v, left = 0.0, left - s
    return out


@kernel
def sensitivities(t, u, x, v, b, plus, minus, r_plus, r_minus, rate=False):
    """The outputs as `positions` gives them, and their derivatives: arrays of (samples,) and (samples, 7)."""
    out, slopes = np.empty(len(t)), np.zeros((len(t), 7))
    dx, dv, dp, dv_next = np.zeros(7), np.zeros(7), np.zeros(7), np.zeros(7)
    dx[5], dv[6] = 1.0, 1.0
    for k in range(len(t)):
        out[k] = v if rate else x
        slopes[k] = dv if rate else dx
        if k + 1 == len(t):
            break
        left, force = t[k + 1] - t[k], b * u[k]
        for _ in range(2):
            way = _direction(v, force, plus, minus)
            if way == 0:
                dv[:] = 0.0
                break
            dp[:] = 0.0
            dp[0] = u[k]
            if way > 0:
                p, r, column = force - plus, r_plus, 3
                dp[1] = -1.0
            else:
                p, r, column = force + minus, r_minus, 4
                dp[2] = 1.0
            s = _stop(v, p, r, left) if v * p < 0.0 else -1.0
            h = s if s >= 0.0 else left
            decay, one, two, one_r, two_r = _phi(r, h)
            for i in range(7):
                dx[i] += dv[i] * one + dp[i] * two
                dv_next[i] = dv[i] * decay + dp[i] * one
            dx[column] += v * one_r + p * two_r
            dv_next[column] += -v * h * decay + p * one_r
            x += v * one + p * two
            if s < 0.0:
                v += (p - r * v) * one
                dv[:] = dv_next
                break
            # From rest for the time left, which s shortens: with the next p and r, v there is p₂ φ₁(left - s), so a
            # change ds is one of the velocity now by -p₂ ds, and moves no position to first order.
            v, left = 0.0, left - s
            turned = _direction(v, force, plus, minus)
            p_next = force - plus if turned > 0 else force + minus
            for i in range(7):
                dv[i] = dv_next[i] / p * p_next if turned != 0 else 0.0
    return out, slopes
