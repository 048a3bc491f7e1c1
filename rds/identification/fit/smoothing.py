"""What the data themselves say of noise and velocity, before there is a model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rds.identification.logs.log import Log
from rds.identification.logs.motion import noise as noise_of

_LONGEST = 0.05  # of a log: the widest difference that a velocity is taken over
_SLOW = 0.03  # of the highest speed: slower is taken for rest
_STILL = 12.0  # noise alone spans 8 standard deviations in 10^4 samples, 10.4 in 10^7
_SPAN = 0.01  # s over which a range of velocities is taken: an encoder's step in one sample is no speed
_ROUGH = 0.2  # of the highest speed: what noise a velocity of that range may have
_REACH = 3.0  # standard deviations by which noise makes the fastest velocities faster
_NOISY = 0.05  # of the highest speed: what noise a velocity may have


@dataclass(frozen=True)
class Motion:
    """Noise and velocity of a log's position. `velocity` (N) is centred at the samples, mm/s; noise is in mm."""

    noise: float  # standard deviation of the position's noise, quantization included
    velocity: np.ndarray
    threshold: float  # mm/s, below which the axis may as well be at rest
    moves: bool  # whether the position changes by more than noise and quantization do


def motion_of(log: Log) -> Motion:
    """Differences of the position over as few samples as noise permits."""
    if "motion" not in log.known:
        log.known["motion"] = _motion_of(log)
    found: Motion = log.known["motion"]
    return found


def _motion_of(log: Log) -> Motion:
    y, t = log.position, log.time
    step = log.resolution or 0.0
    noise = max(noise_of(y), step / np.sqrt(12.0))
    moves = bool(np.ptp(y) > max(2.5 * step, _STILL * noise))
    half, longest = 1, max(1, int(_LONGEST * len(y) / 2))
    while True:
        velocity = _difference(t, y, half)
        fastest = float(np.abs(velocity).max())
        uncertain = noise * np.sqrt(2.0) / (2 * half * log.sample_period)
        if uncertain <= _NOISY * fastest or 2 * half > longest:
            return Motion(noise, velocity, max(2.0 * uncertain, _SLOW * fastest), moves)
        half *= 2


def speed_range(log: Log) -> tuple[float, float]:
    """The lowest and highest velocity of a log, mm/s, less what noise adds to them; of a speed its own."""
    y, t = log.position, log.time
    if log.is_rate:
        return float(y.min()), float(y.max())
    step, longest = max(round(_SPAN / log.sample_period), 1), max(int(_LONGEST * len(y)), 1)
    while True:
        step = min(step, len(y) - 1)
        rate = (y[step:] - y[:-step]) / (t[step:] - t[:-step])
        low, high = float(rate.min()), float(rate.max())
        unsure = motion_of(log).noise * np.sqrt(2.0) / (step * log.sample_period)
        if unsure <= _ROUGH * max(-low, high) or 2 * step > longest:
            extra = float(min(_REACH * unsure, 0.5 * (high - low)))
            return low + extra, high - extra
        step *= 2


def _difference(t: np.ndarray, y: np.ndarray, half: int) -> np.ndarray:
    index = np.arange(len(y))
    before, after = np.maximum(index - half, 0), np.minimum(index + half, len(y) - 1)
    return (y[after] - y[before]) / (t[after] - t[before])


def encoder_step(y: np.ndarray) -> float | None:
    """The step that all differences of the position are whole multiples of; None where there is none."""
    changes = np.abs(np.diff(y))
    changes = changes[changes > 0.0]
    if len(changes) < 8:
        return None
    step = float(changes.min())
    multiples = changes / step
    return step if float(np.abs(multiples - np.round(multiples)).max()) < 0.01 else None
