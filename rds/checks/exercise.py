"""What a controller is exercised with: an ordinary axis and ordinary references."""

from __future__ import annotations

from math import exp, pi, sin

import numpy as np

TAU, GAIN = 9.943e-3, 1.764  # s, (mm/s)/V: the X axis of mini-cnc-rds, table 1
VOLTAGE_LIMIT = 10.0  # V: the converter's; an unstable law stays finite behind it, as at the machine

_PARTS = ((0.2, 500), (2.0, 700))  # Hz, samples of a sine of _AMPLITUDE
_STEPS = ((5.0, 250), (-5.0, 250), (0.0, 100))  # mm, samples
_AMPLITUDE = 5.0  # mm
_START = 0.25  # mm
_LOAD = 1.0, 3.0  # V, Hz: an unknown load, so that the position changes under a law that gives 0 V, too


class LinearAxis:
    """τẍ + ẋ = K u, exact over a sample of constant voltage, without friction."""

    def __init__(self, sample_period: float):
        self.position, self.velocity = _START, 0.0
        self._decay = exp(-sample_period / TAU)
        self._T = sample_period

    def move(self, t: float, voltage: float) -> None:
        """One sample on from time `t` (s), under `voltage` (V) as the converter limits it and a load."""
        load = _LOAD[0] * sin(2 * pi * _LOAD[1] * t)
        final = GAIN * (min(max(voltage, -VOLTAGE_LIMIT), VOLTAGE_LIMIT) + load)
        gained = TAU * (1.0 - self._decay)
        self.position += final * self._T + (self.velocity - final) * gained
        self.velocity = final + (self.velocity - final) * self._decay


def references(sample_period: float) -> np.ndarray:
    """Position (mm), velocity (mm/s) and acceleration (mm/s²) at each sample: shape (samples, 3)."""
    rows = []
    for frequency, samples in _PARTS:
        w = 2 * pi * frequency
        angle = w * sample_period * np.arange(samples)
        rows.append(_AMPLITUDE * np.stack([np.sin(angle), w * np.cos(angle), -w * w * np.sin(angle)], axis=1))
    for height, samples in _STEPS:
        rows.append(np.tile([height, 0.0, 0.0], (samples, 1)))
    return np.concatenate(rows)
