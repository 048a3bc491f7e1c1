"""Values to begin a fit of the axis with where it rests for much of the time: a grid over what makes it rest.

With τ and the friction in volts (w₊ = F₊/K, w₋ = F₋/K) given, when the axis sticks and slips is known, and the motion
is proportional to K:

    y = y₀ + K·z(t; τ, w₊, w₋),      τ z'' = u - w± - z'

So K follows from a line through the measured positions over z, and three numbers are left to try. Unlike a regression
on where the measured velocity looks like zero, this needs no velocity: slow and short motions count as what they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from rds.core.compiling import COMPILED
from rds.core.extras import needed_for
from rds.identification.logs.log import Log, excited_part
from rds.identification.structures.axis_motion import MINUS, PLUS, POSITION, STRIBECK_VELOCITY, TAU, move
from rds.identification.structures.axis_motion import K as GAIN

_TIMES = 6 if COMPILED else 5  # time constants that are tried
_LEVELS = 7 if COMPILED else 4  # of friction, each way
_MOST_SAMPLES = 20_000 if COMPILED else 1_000  # of each log
_LEAST, _LARGEST = 0.02, 0.92  # friction as a share of the largest voltage that way
_KEPT = 3
_WALK = 120  # runs from each place kept
_SIMPLEX = np.vstack([np.zeros(3), 0.2 * np.eye(3)])  # to begin the walk with, in logarithms
_RIGHT = 0.5  # of the motion's variance: a gain of the wrong sign leaves more


class _Place(NamedTuple):
    cost: float  # sum of squares that is left, mm²
    sign: float  # of K
    gain: float  # its size
    numbers: tuple[float, float, float]  # τ, w₊, w₋
    at: tuple[int, int]  # of w₊ and w₋ in the grid


def stick_starts(logs: Sequence[Log]) -> Iterator[tuple[np.ndarray, float]]:
    """(K, F₊, F₋) and τ (s), from the best places of the grid whose friction differs, the best first."""
    parts = [excited_part(log, _MOST_SAMPLES) for log in logs]
    whole = sum(len(part) * float(part.position.var()) for part in parts)
    places = _places(parts, 1.0)
    if not places or places[0].cost > _RIGHT * whole:
        places = sorted([*places, *_places(parts, -1.0)], key=lambda place: place.cost)
    chosen: list[_Place] = []
    for place in places:
        if len(chosen) == _KEPT:
            break
        if not any(_near(place, other) for other in chosen):
            chosen.append(place)
            yield _walked(parts, place)


def _near(one: _Place, other: _Place) -> bool:
    """Whether friction is about the same: a search finds the time constant from wherever it begins."""
    return all(abs(a - b) <= 1 for a, b in zip(one.at, other.at, strict=True))


def _places(parts: Sequence[Log], sign: float) -> list[_Place]:
    """The grid for a gain of this sign, the best first."""
    longest = max(float(part.time[-1] - part.time[0]) for part in parts)
    finest = min(part.sample_period for part in parts)
    times = np.geomspace(0.3 * finest, max(0.05 * longest, 4.0 * finest), _TIMES)
    shares = _LEAST + (_LARGEST - _LEAST) * np.linspace(0.0, 1.0, _LEVELS) ** 1.5
    peak = max(0.0, *(float((sign * part.command).max()) for part in parts))
    dip = min(0.0, *(float((sign * part.command).min()) for part in parts))
    plus, minus = shares * (peak or -dip), shares * (dip or -peak)
    found = []
    for i, j, m in np.ndindex(_TIMES, _LEVELS, _LEVELS):
        gain, cost = _line(parts, sign, float(times[i]), float(plus[j]), float(minus[m]))
        if gain > 0.0:
            found.append(_Place(cost, sign, gain, (float(times[i]), float(plus[j]), float(minus[m])), (j, m)))
    return sorted(found, key=lambda place: place.cost)


def _walked(parts: Sequence[Log], place: _Place) -> tuple[np.ndarray, float]:
    """From a place down to the lowest nearby, by Nelder and Mead's simplex, which minds no kinks."""
    with needed_for("a fit"):
        from scipy.optimize import minimize

    def cost(scaled: np.ndarray) -> float:
        tau, plus, minus = np.exp(scaled) * place.numbers
        gain, left = _line(parts, place.sign, tau, plus, minus)
        return left if gain > 0.0 else inf

    best = minimize(cost, np.zeros(3), method="Nelder-Mead", options={"initial_simplex": _SIMPLEX, "maxfev": _WALK})
    tau, plus, minus = np.exp(best.x) * place.numbers
    gain, _ = _line(parts, place.sign, tau, plus, minus)
    return np.array([place.sign * gain, gain * plus, gain * minus]), float(tau)


def _line(parts: Sequence[Log], sign: float, tau: float, plus: float, minus: float) -> tuple[float, float]:
    """K of the line through the positions over z, and the sum of squares that it leaves, mm²; 0 for no motion."""
    p, rest, columns = np.zeros(POSITION), np.zeros(3), np.empty(0, dtype=np.int64)
    p[TAU], p[GAIN], p[PLUS], p[MINUS], p[STRIBECK_VELOCITY] = tau, 1.0, plus, minus, 1.0
    zz = zy = yy = 0.0
    for part in parts:
        z, y = np.empty(len(part)), part.position - part.position.mean()
        move(part.time, sign * part.command, rest, p, columns, z, np.empty((len(z), 0)), False)
        z -= z.mean()
        # not by BLAS, whose threads wait for each other longer than so short a sum takes
        zz, zy, yy = zz + float((z * z).sum()), zy + float((z * y).sum()), yy + float((y * y).sum())
    gain = zy / zz if zz > 0.0 else 0.0
    return gain, yy - gain * zy
