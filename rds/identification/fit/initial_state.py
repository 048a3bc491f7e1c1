"""The state in which a log begins, estimated from its first samples with the model that is being judged."""

from __future__ import annotations

from collections.abc import Mapping
from math import expm1

import numpy as np

from rds.identification.structures.structure import Structure

INITIAL_SAMPLES = 50  # from which the initial state is estimated, and which no error counts
LEAST = 10
_ROUNDS = 8
_STEP = 1e-4  # of a state's scale, for finite differences
_ENOUGH = 1e-9  # relative gain below which the search ends
_FEW = 8  # samples of a first slope
_SLACK = 0.1  # by which the first velocity may leave those that the samples show


def initial_samples(length: int) -> int:
    """From how many of its first samples the initial state of a log with so many is estimated."""
    return max(min(INITIAL_SAMPLES, length // 10), LEAST)


def estimate_start(
    structure: Structure, values: Mapping[str, float], t: np.ndarray, u: np.ndarray, y: np.ndarray
) -> tuple[float, ...]:
    """The initial state with the smallest sum of squares of output errors over the samples given, by Gauss-Newton.

    Position (mm; a spindle's speed) begins at the first measurement, velocity (mm/s) at the slope, further states at
    zero. The velocity stays among those that these samples show: a wrong model may not begin with a leap that hides
    its error. A state that the samples do not tell stays where it began (least norm). Where the model's answer is not
    finite, the search ends with the best state so far.
    """
    x, low, high = _first_guess(structure.states, t, y)
    low[1:2] -= (unknown := _unknown_change(values, u))
    high[1:2] += unknown
    free = np.ones(len(x), dtype=bool)
    found = _search(structure, values, t, u, y, x, free)
    within = np.clip(found, low, high)
    if (within != found).any():
        found = _search(structure, values, t, u, y, within, within == found)
    return tuple(float(value) for value in found)


def first_velocities(
    structure: Structure, values: Mapping[str, float], t: np.ndarray, u: np.ndarray, y: np.ndarray
) -> tuple[float, float]:
    """The lowest and highest velocity that the samples show at their beginning, with `estimate_start`'s slack."""
    _, low, high = _first_guess(structure.states, t, y)
    unknown = _unknown_change(values, u)
    return float(low[1]) - unknown, float(high[1]) + unknown


def _unknown_change(values: Mapping[str, float], u: np.ndarray) -> float:
    """By how much commands from before the log may change the velocity, which a delay brings into its beginning."""
    delay, tau, K = (values.get(name, 0.0) for name in ("delay", "tau", "K"))
    return float(np.ptp(u)) * abs(K) * -expm1(-delay / tau) if delay > 0.0 and tau > 0.0 else 0.0


def _search(
    structure: Structure,
    values: Mapping[str, float],
    t: np.ndarray,
    u: np.ndarray,
    y: np.ndarray,
    x: np.ndarray,
    free: np.ndarray,
) -> np.ndarray:
    """Gauss-Newton from `x`, moving the states that are `free`."""
    error = _error(structure, values, t, u, y, x)
    scale = np.maximum(np.abs(x), max(float(np.ptp(y)), 1e-6))
    for _ in range(_ROUNDS):
        if not np.isfinite(error).all() or not free.any():
            break
        steps = _STEP * np.diag(scale)[free]
        slopes = [(_error(structure, values, t, u, y, x + step) - error) / step.max() for step in steps]
        jacobian = np.stack(slopes, axis=1)
        if not np.isfinite(jacobian).all():
            break
        moved = x.copy()
        moved[free] -= np.linalg.lstsq(jacobian, error, rcond=1e-8)[0]
        new = _error(structure, values, t, u, y, moved)
        before, after = float(error @ error), float(new @ new)
        if not after < before:
            break
        x, error = moved, new
        if before - after <= _ENOUGH * before:
            break
    return x


def _first_guess(states: int, t: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where the search begins, and the bounds of each state."""
    x, low, high = np.zeros(states), np.full(states, -np.inf), np.full(states, np.inf)
    x[0] = y[0]
    if states > 1 and len(y) > _FEW:
        few = min(_FEW, (len(y) - 1) // 2)  # of so few samples that two windows after one another fit into them
        slopes = (y[few:] - y[:-few]) / (t[few:] - t[:-few])
        x[1] = np.polyfit(t[:_FEW] - t[0], y[:_FEW], 1)[0]
        # at a window's edge the velocity is off its mean by half of what it changes over the window, and by more where
        # the axis stops or turns in it
        change = float(np.abs(slopes[few:] - slopes[:-few]).max(initial=0.0))
        slack = change + _SLACK * float(np.abs(slopes).max())
        low[1], high[1] = min(slopes.min(), x[1]) - slack, max(slopes.max(), x[1]) + slack
    return x, low, high


def _error(
    structure: Structure, values: Mapping[str, float], t: np.ndarray, u: np.ndarray, y: np.ndarray, x: np.ndarray
) -> np.ndarray:
    with np.errstate(all="ignore"):
        return np.asarray(structure.respond(t, u, [float(value) for value in x], values), dtype=float) - y
