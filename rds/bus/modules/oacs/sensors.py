"""Readings of a module's sensors: the accelerometer's three channels and the motor's current.

ADXL335 behind a 10-bit converter: 330 mV/g about half the supply of 3.3 V. The readings at rest of table 19 (404, 522,
499) are -1.05, 0.10 and -0.13 g when 1024 levels are 3.3 V, which is gravity along -X; with the 5 V of the text they
would be 0.98, 2.72 and 2.38 g, which cannot be. So the reference is 3.3 V, and equation 9.1 reads

    acceleration = (3.3 V reading/2^10 - 1.65 V)/(0.33 V/g)

(its n² stands for 2^n, its V_norm for half the supply).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sin

LEVELS = 1024
REFERENCE = 3.3  # V
SENSITIVITY = 0.33  # V/g
_TONES = ((1.0, 0.55), (2.17, 0.3), (3.71, 0.15))  # of the vibration: multiples of the shaft's rate, and shares
_SHAFT = 9.7  # Hz: 580 rev/min


def gravities(reading: float) -> float:
    """The acceleration of a 10-bit reading, in g (9.81 m/s²)."""
    return (REFERENCE * reading / LEVELS - 0.5 * REFERENCE) / SENSITIVITY


def vibrating(rest: Sequence[int], amplitude: Sequence[int], share: float, at: float) -> list[int]:
    """The three readings at the instant `at` (s), with the shaft at `share` (0 to 1) of its full speed.

    A few tones at multiples of the shaft's rate, out of phase between the channels: the same run gives the same
    readings. The thesis's recording has no spectrum to copy.
    """
    readings = []
    for channel, (middle, swing) in enumerate(zip(rest, amplitude, strict=True)):
        wave = sum(part * sin(2 * pi * _SHAFT * tone * at + 2.1 * channel * tone) for tone, part in _TONES)
        readings.append(min(max(round(middle + share * swing * wave), 0), LEVELS - 1))
    return readings


def motor_current(voltage: float, speed: float, start: float, run: float, supply: float, full_speed: float) -> float:
    """The motor's current, A: `start` at the supply (V) and at rest, `run` at the supply and at full speed.

    In between the back electromotive force takes its share: i = start u/supply - (start - run) v/full_speed.
    """
    if not full_speed:
        return 0.0
    current = start * voltage / supply - (start - run) * speed / full_speed
    return abs(current)


def swing(amplitude: float, share: float, position: float, lead: float) -> float:
    """What a screw that runs unevenly adds to the current, A: `amplitude` at full speed, once in each turn.

    `share` (0 to 1) is of the full speed, `position` and `lead` are in one unit. The currents of figures 94 and 95 have
    such a trend, by a power screw that is harder to turn in one part of its turn than in the other (10.1.4).
    """
    return amplitude * min(share, 1.0) * sin(2 * pi * position / lead)
