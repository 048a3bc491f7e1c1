"""The speed of a spindle as a first-order loop, solved exactly, with exact sensitivities.

    τ v' + v = K (u(t - L) + u₀)        v in rev/min, u in V

Voltages are held from each time to the next and act L s later; the first acts from the beginning. The columns of
sensitivities are τ, K, u₀, L and the initial speed.
"""

from __future__ import annotations

from math import exp

import numpy as np

from rds.core.compiling import kernel

COLUMNS = 5


@kernel
def sensitivities(t, u, v, tau, K, offset, delay):
    """The speed at each of the times `t`, and its derivatives: arrays of (samples,) and (samples, 5)."""
    out, slopes = np.empty(len(t)), np.zeros((len(t), 5))
    dv = np.zeros(5)
    dv[4] = 1.0
    acting = 0  # which voltage acts
    for k in range(len(t)):
        out[k] = v
        slopes[k] = dv
        if k + 1 == len(t):
            break
        now, end = t[k], t[k + 1]
        while now < end:
            due = acting + 1 < len(t) and t[acting + 1] + delay < end
            until = max(t[acting + 1] + delay, now) if due else end
            h, drive = until - now, u[acting] + offset
            decay = exp(-h / tau)
            final = K * drive
            for i in range(5):
                dv[i] *= decay
            dv[0] += (v - final) * decay * h / (tau * tau)
            dv[1] += drive * (1.0 - decay)
            dv[2] += K * (1.0 - decay)
            v = final + (v - final) * decay
            if due:
                acting += 1
                dv[3] -= K * (u[acting] - u[acting - 1]) / tau  # the later it acts, the shorter it has acted
            now = until
            if not due:
                break
    return out, slopes
