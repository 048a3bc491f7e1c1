"""The state in which a log begins, estimated from its first samples with the model that is being judged."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rds.identification.structure import Structure

_ROUNDS = 8
_STEP = 1e-4  # of a state's scale, for finite differences
_ENOUGH = 1e-9  # relative gain below which the search ends


def estimate_start(
    structure: Structure, values: Mapping[str, float], t: np.ndarray, u: np.ndarray, y: np.ndarray
) -> tuple[float, ...]:
    """The initial state with the smallest sum of squares of output errors over the samples given, by Gauss-Newton.

    Position (mm; a spindle's speed) begins at the first measurement, velocity (mm/s) at the slope, further states at
    zero. A state that these samples do not tell stays where it began (least norm). Where the model's answer is not
    finite, the search ends with the best state so far.
    """
    x = _first_guess(structure.states, t, y)
    error = _error(structure, values, t, u, y, x)
    scale = np.maximum(np.abs(x), max(float(np.ptp(y)), 1e-6))
    for _ in range(_ROUNDS):
        if not np.isfinite(error).all():
            break
        slopes = [
            (_error(structure, values, t, u, y, x + np.where(np.arange(len(x)) == i, _STEP * scale, 0.0)) - error)
            / (_STEP * scale[i])
            for i in range(len(x))
        ]
        jacobian = np.stack(slopes, axis=1)
        if not np.isfinite(jacobian).all():
            break
        moved = x - np.linalg.lstsq(jacobian, error, rcond=1e-8)[0]
        new = _error(structure, values, t, u, y, moved)
        before, after = float(error @ error), float(new @ new)
        if not after < before:
            break
        x, error = moved, new
        if before - after <= _ENOUGH * before:
            break
    return tuple(float(value) for value in x)


def _first_guess(states: int, t: np.ndarray, y: np.ndarray) -> np.ndarray:
    x = np.zeros(states)
    x[0] = y[0]
    if states > 1 and len(y) > 2:
        few = slice(0, min(len(y), 8))
        x[1] = np.polyfit(t[few] - t[0], y[few], 1)[0]
    return x


def _error(
    structure: Structure, values: Mapping[str, float], t: np.ndarray, u: np.ndarray, y: np.ndarray, x: np.ndarray
) -> np.ndarray:
    with np.errstate(all="ignore"):
        return np.asarray(structure.respond(t, u, [float(value) for value in x], values), dtype=float) - y
