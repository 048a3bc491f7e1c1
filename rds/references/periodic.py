"""Square, triangle and sinusoid, as a function generator gives them, and a constant.

Amplitude is from the middle to the peak. With phase 0 all start at the middle going up (the square: at its top).
Sample times k T carry rounding errors: an edge counts as reached from 1e-9 of a period before it.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from rds.core.quantities import Quantity
from rds.references.signal import Motion, Signal

_EDGE = 1e-9  # of a period
OPTIONS = {
    "amplitude": Quantity("middle to peak; to turn the signal over, use phase = 180", "V or mm", low=0.0),
    "frequency": Quantity("frequency", "Hz", above=0.0),
    "offset": Quantity("middle of the signal", "V or mm"),
    "phase": Quantity("phase", "degrees"),
    "value": Quantity("constant value", "V or mm"),
}


def square(amplitude: float, frequency: float, offset: float = 0.0, phase: float = 0.0) -> Signal:
    """`offset` + `amplitude` for half a period, then `offset` - `amplitude`; velocity and acceleration are 0.

    V or mm, Hz, degrees. A step has no velocity that an axis could follow, so the reference asks for none.
    Raises InputError for a value that is no number, a negative amplitude or a frequency that is not positive.
    """
    return _periodic("square", _square, amplitude, frequency, offset, phase)


def triangle(amplitude: float, frequency: float, offset: float = 0.0, phase: float = 0.0) -> Signal:
    """From `offset` up to `amplitude` above it, down to `amplitude` below it and back, at constant speed.

    V or mm, Hz, degrees. The velocity is the slope, at a corner that of the side that begins; the acceleration is 0.
    Raises InputError as `square` does.
    """
    return _periodic("triangle", _triangle, amplitude, frequency, offset, phase)


def sinusoid(amplitude: float, frequency: float, offset: float = 0.0, phase: float = 0.0) -> Signal:
    """`offset` + `amplitude` sin(2π `frequency` t + `phase`), with its exact derivatives.

    V or mm, Hz, degrees. Raises InputError as `square` does.
    """
    return _periodic("sinusoid", _sinusoid, amplitude, frequency, offset, phase)


def constant(value: float) -> Signal:
    """`value` (V or mm) at all times. Raises InputError for a value that is no finite number."""
    level = OPTIONS["value"].check(value, "value", "constant")
    return Signal("constant", partial(_constant, value=level), settings={"value": level})


def _periodic(kind: str, motion: Any, amplitude: Any, frequency: Any, offset: Any, phase: Any) -> Signal:
    given = {"amplitude": amplitude, "frequency": frequency, "offset": offset, "phase": phase}
    settings = {name: OPTIONS[name].check(value, name, kind) for name, value in given.items()}
    return Signal(kind, partial(motion, **settings), 1.0 / settings["frequency"], settings)


def _square(t: np.ndarray, amplitude: float, frequency: float, offset: float, phase: float) -> Motion:
    half_periods = np.floor(2.0 * (t * frequency + phase / 360.0 + _EDGE))
    position = offset + np.where(half_periods % 2 == 0, amplitude, -amplitude)
    return position, np.zeros_like(t), np.zeros_like(t)


def _triangle(t: np.ndarray, amplitude: float, frequency: float, offset: float, phase: float) -> Motion:
    periods = t * frequency + phase / 360.0
    # Counted from the corner below, the first half of a period rises and the second falls.
    since = periods + 0.25 - np.floor(periods + 0.25 + _EDGE)
    rising = since < 0.5 - _EDGE
    position = offset + amplitude * np.where(rising, 4.0 * since - 1.0, 3.0 - 4.0 * since)
    slope = 4.0 * amplitude * frequency
    return position, np.where(rising, slope, -slope), np.zeros_like(t)


def _sinusoid(t: np.ndarray, amplitude: float, frequency: float, offset: float, phase: float) -> Motion:
    omega = 2.0 * np.pi * frequency
    angle = omega * t + np.deg2rad(phase)
    swing = amplitude * np.sin(angle)
    return offset + swing, amplitude * omega * np.cos(angle), -(omega**2) * swing


def _constant(t: np.ndarray, value: float) -> Motion:
    return np.full_like(t, value), np.zeros_like(t), np.zeros_like(t)
