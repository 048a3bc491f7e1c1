"""Improved Tustin: the corners of Tustin, on a circle that is ER outside, so that ER and the chord height EH are equal.

With both one BLU, cos(α/2) = (R - 1)/(R + 1), so α ≅ 4/√R, and a quadrant takes N = (π/8) √R steps, R in BLU
(oacs-thesis, eq. 7.47 to 7.49; the right side of eq. 15 in mrm-control lacks the root).

Start and end of an arc are on its circle. A first or last step from R to R + E whose chord reaches R - E turns by
φ + ψ, the steps between by 2 ψ, with sin²(φ/2) = E/(2 R) and tan²(ψ/2) = E/R; n steps turn by 2 φ + 2 (n - 1) ψ. E is
the smallest with which the number of steps that one BLU asks for goes round: at most one BLU.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import asin, atan, ceil, copysign, sqrt
from typing import Any

import numpy as np

from rds.core.types import Segment
from rds.interpolators import reference_word
from rds.interpolators.division import Method, Turn, rotated
from rds.interpolators.tustin import factor

OPTIONS, DEFAULTS = reference_word.OPTIONS, reference_word.DEFAULTS


def _angles(share: float) -> tuple[float, float]:
    """φ and ψ (rad) for the error E = `share` R."""
    return 2.0 * asin(sqrt(0.5 * share)), 2.0 * atan(sqrt(share))


def _share(turn: Turn, n: int) -> float:
    """E / R with which `n` steps go just round."""
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        phi, psi = _angles(middle)
        low, high = (middle, high) if 2.0 * (phi + (n - 1) * psi) < abs(turn.sweep) else (low, middle)
    return high


def _least(turn: Turn, bound: float) -> int:
    phi, psi = _angles(min(1.0, bound / turn.radius))
    return 1 + max(0, ceil((0.5 * abs(turn.sweep) - phi) / psi - 1e-9))


def _deviation(turn: Turn, n: int) -> float:
    return turn.radius * _share(turn, n)


def _corners(turn: Turn, n: int) -> Iterator[complex]:
    if n < 2:
        return
    share = _share(turn, n)
    phi, psi = (copysign(angle, turn.sweep) for angle in _angles(share))
    first = turn.arm * (1.0 + share) * factor(phi + psi)
    yield first
    yield from rotated(Turn(first, turn.sweep), factor(2.0 * psi), n - 2)


def _widest(turn: Turn, n: int) -> float:
    phi, psi = _angles(_share(turn, n))
    return {1: 2.0 * phi, 2: phi + psi}.get(n, 2.0 * psi)


METHOD = Method("improved-tustin", lambda R: 4.0 / sqrt(R), _deviation, _corners, _widest, _least)


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows (mm, mm/s, mm/s²) every `T` s; see `rds.interpolators.reference_word`."""
    return reference_word.interpolate(segment, T, params, METHOD)
