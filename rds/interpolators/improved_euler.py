"""Improved Euler: X is stepped as by Euler, and Y with the new X. The corners are on an ellipse: errors do not add up.

    X(i+1) = X(i) - α Y(i),  Y(i+1) = Y(i) + α X(i+1)

keeps X² + Y² - α X Y, so that r² (1 - (α/2) sin 2θ) is the same at all corners. From an axis the radial error is
at most α R / 4: one BLU for α = 4/R, R in BLU.
"""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Iterator, Mapping
from math import asin, atan2, ceil, copysign, cos, floor, inf, pi, sin, sqrt
from typing import Any

import numpy as np

from rds.core.types import Segment
from rds.interpolators import reference_word
from rds.interpolators.division import Method, Turn

OPTIONS, DEFAULTS = reference_word.OPTIONS, reference_word.DEFAULTS
_WIDEST = 1.9  # from 2 on, the corners are on no ellipse
_NEWTON = 3  # corrections of the step angle; each leaves a small part of the error


def _alpha(turn: Turn, n: int) -> float:
    """The step angle with which `n` steps go to the direction of the end: near the mean one, 2 sin(sweep / 2 n)."""
    mean = alpha = 2.0 * sin(0.5 * turn.sweep / n)
    for _ in range(_NEWTON):
        alpha -= phase(_after(turn.arm, alpha, n) / (turn.arm * rect(1.0, turn.sweep))) / n
        alpha = copysign(min(max(abs(alpha), 0.7 * abs(mean)), 1.3 * abs(mean)), mean)  # few steps: no farther
    return alpha


def _after(arm: complex, alpha: float, n: int) -> complex:
    """The corner after `n` steps M of the recursion: Mⁿ = (sin nδ M - sin (n-1)δ) / sin δ, where 2 cos δ = 2 - α²."""
    delta = 2.0 * asin(0.5 * alpha)
    x = arm.real - alpha * arm.imag
    once = complex(x, arm.imag + alpha * x)
    return (sin(n * delta) * once - sin((n - 1) * delta) * arm) / sin(delta)


def _deviation(turn: Turn, n: int) -> float:
    return max(_outside_inside(turn, n))


def _outside_inside(turn: Turn, n: int) -> tuple[float, float]:
    alpha, R = _alpha(turn, n), turn.radius
    if abs(alpha) > _WIDEST:
        return inf, inf
    first = atan2(turn.arm.imag, turn.arm.real)
    low, high = sorted((first, first + turn.sweep))
    # sin 2θ is largest at 45° + k 180°, smallest at 135° + k 180°
    quarters = range(ceil(low / (pi / 2) - 0.5), floor(high / (pi / 2) - 0.5) + 1)
    turning = [pi / 4 + k * pi / 2 for k in quarters]
    kept = 1.0 - 0.5 * alpha * sin(2.0 * first)
    radii = [R * sqrt(kept / (1.0 - 0.5 * alpha * sin(2.0 * angle))) for angle in (low, high, *turning)]
    inside = R - min(radii) + R * (1.0 - cos(0.5 * (1.0 + abs(alpha)) * turn.sweep / n))  # steps differ a little
    return max(radii) - R, inside


def _corners(turn: Turn, n: int) -> Iterator[complex]:
    alpha, x, y = _alpha(turn, n), turn.arm.real, turn.arm.imag
    for _ in range(n - 1):
        x -= alpha * y
        y += alpha * x
        yield complex(x, y)


METHOD = Method(
    "improved-euler",
    lambda R: 4.0 / R,
    _deviation,
    _corners,
    inside=lambda turn, n: _outside_inside(turn, n)[1],
)


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows (mm, mm/s, mm/s²) every `T` s; see `rds.interpolators.reference_word`."""
    return reference_word.interpolate(segment, T, params, METHOD)
