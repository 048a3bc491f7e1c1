"""How much faster than planned the planned samples can be passed: what a feed override above 100 % may use.

At r times the planned rate an axis has the velocity r v, the acceleration r² a + ṙ v and a jerk of about r³ j. Where
the plan uses an axis to its limit, r is 1; before it r must have fallen to that, as fast as the acceleration that r²a
leaves over lets it: a pass backwards over the samples sees to that.
"""

from __future__ import annotations

import numpy as np

from rds.motion.compiling import kernel
from rds.runtime.retimed import SPARE

MOST = 2.0  # override


@kernel
def _backwards(cap, velocity, acceleration, limit, T, fastest):
    """Lower each cap so that the next one can be reached from it."""
    n, axes = velocity.shape
    for i in range(n - 2, -1, -1):
        after = cap[i + 1]
        if cap[i] <= after:
            continue
        rate = after
        fall = fastest
        for _ in range(2):  # the room at the lower rate, then at the higher one: on the safe side
            fall = fastest
            for k in range(axes):
                v = abs(velocity[i, k])
                if v > 0.0:
                    room = (limit[k] - rate * rate * abs(acceleration[i, k])) / v
                    fall = min(fall, max(room, 0.0))
            rate = min(cap[i], after + fall * T / max(rate, 1.0))
        cap[i] = min(cap[i], after + fall * T / max(rate, 1.0))


def caps(velocity: np.ndarray, acceleration: np.ndarray, limits: np.ndarray, T: float, fastest: float) -> np.ndarray:
    """For each planned sample the most that its rate may be, from 1 to 2.

    velocity, acceleration: samples × axes; limits: velocity, acceleration and jerk × axes; T: s between samples;
    fastest: 1/s that the rate may change by.
    """
    cap = np.full(len(velocity), MOST)
    jerk = np.abs(np.diff(acceleration, axis=0, append=acceleration[-1:])) / T
    for values, most, power in ((velocity, limits[0], 1.0), (acceleration, limits[1], 2.0), (jerk, limits[2], 3.0)):
        with np.errstate(divide="ignore", over="ignore"):
            cap = np.minimum(cap, ((most / np.abs(values)) ** (1.0 / power)).min(axis=1))
    cap = np.minimum(cap, np.minimum(np.append(cap[1:], MOST), np.insert(cap[:-1], 0, MOST)))  # between samples too
    cap = np.maximum(cap, 1.0)
    _backwards(cap, velocity, acceleration, SPARE * limits[1], T, fastest)
    return cap
