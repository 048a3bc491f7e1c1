"""A staircase: up through equal steps to the peak, down through the middle to the lowest, and back, over and over."""

from __future__ import annotations

from functools import partial

import numpy as np

from rds.core.quantities import Quantity
from rds.references.signal import Motion, Signal

_EDGE = 1e-9  # of a step: an edge counts as reached from so much before it, since sample times carry rounding errors
OPTIONS = {
    "amplitude": Quantity("middle to peak", "V or mm", low=0.0),
    "frequency": Quantity("of the whole way up, down and back", "Hz", above=0.0),
    "steps": Quantity("steps from the middle to the peak", low=1, whole=True),
    "offset": Quantity("middle of the signal", "V or mm"),
}


def staircase(amplitude: float, frequency: float, steps: int, offset: float = 0.0) -> Signal:
    """`offset` for a 4·`steps`-th of a period, then one step of `amplitude`/`steps` up, and so on to the peak and back.

    V or mm, Hz. Velocity and acceleration are 0. Raises InputError for a value that will not do.
    """
    given = {"amplitude": amplitude, "frequency": frequency, "steps": steps, "offset": offset}
    settings = {name: OPTIONS[name].check(value, name, "staircase") for name, value in given.items()}
    motion = partial(_staircase, **settings)
    fastest = 2.0 * settings["steps"] * settings["frequency"]  # every level needs a sample
    return Signal("staircase", motion, 1.0 / settings["frequency"], settings, fastest=fastest)


def _staircase(t: np.ndarray, amplitude: float, frequency: float, steps: int, offset: float) -> Motion:
    since_lowest = np.floor(t * frequency * 4 * steps + _EDGE) + steps
    level = (steps - np.abs(since_lowest % (4 * steps) - 2 * steps)) / steps
    return offset + amplitude * level, np.zeros_like(t), np.zeros_like(t)
