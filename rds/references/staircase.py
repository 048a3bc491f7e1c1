"""A staircase: up through equal steps to the peak, down through the middle to the lowest, and back, over and over."""

from __future__ import annotations

from functools import partial

import numpy as np

from rds.core.errors import InputError
from rds.core.options import Option
from rds.references.signal import Motion, Signal

_EDGE = 1e-9  # of a step: an edge counts as reached from so much before it, since sample times carry rounding errors
_OPTIONS = {
    "amplitude": Option("middle to peak, V or mm", at_least=0.0),
    "frequency": Option("Hz, of the whole way up, down and back", more_than=0.0),
    "steps": Option("from the middle to the peak, a whole number", at_least=1.0),
    "offset": Option("middle of the signal, V or mm"),
}


def staircase(amplitude: float, frequency: float, steps: int, offset: float = 0.0) -> Signal:
    """`offset` for a 4·`steps`-th of a period, then one step of `amplitude`/`steps` up, and so on to the peak and back.

    V or mm, Hz. Velocity and acceleration are 0. Raises InputError for a value that will not do.
    """
    given = {"amplitude": amplitude, "frequency": frequency, "steps": steps, "offset": offset}
    settings = {name: _OPTIONS[name].check(value, name, "staircase") for name, value in given.items()}
    if settings["steps"] != int(settings["steps"]):
        raise InputError(f"staircase: steps = {steps!r} must be a whole number ({_OPTIONS['steps'].meaning})")
    count = int(settings["steps"])
    levels = np.concatenate([np.arange(count), np.arange(count, -count, -1), np.arange(-count, 0)]) / count
    motion = partial(
        _staircase,
        levels=settings["offset"] + settings["amplitude"] * levels,
        frequency=settings["frequency"],
    )
    fastest = len(levels) * 0.5 * settings["frequency"]  # every level needs a sample
    return Signal("staircase", motion, 1.0 / settings["frequency"], {**settings, "steps": count}, fastest=fastest)


def _staircase(t: np.ndarray, levels: np.ndarray, frequency: float) -> Motion:
    at = np.floor(t * frequency * len(levels) + _EDGE).astype(int) % len(levels)
    return levels[at], np.zeros_like(t), np.zeros_like(t)
