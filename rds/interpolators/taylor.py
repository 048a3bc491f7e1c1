"""Taylor: A = 1 - α²/2, B = α. A step makes the radius √(1 + α⁴/4) times longer: far less than Euler, but it adds up.

The chord height error is the larger one for all ordinary arcs: α = √(8/R), R in BLU.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import sqrt, tan
from typing import Any

import numpy as np

from rds.core.types import Segment
from rds.interpolators import reference_word
from rds.interpolators.division import Method, Turn, grown, rotated

OPTIONS, DEFAULTS = reference_word.OPTIONS, reference_word.DEFAULTS


def _alpha(turn: Turn, n: int) -> float:
    t = tan(turn.sweep / n)  # = α / (1 - α²/2)
    return 2.0 * t / (1.0 + sqrt(1.0 + 2.0 * t * t))


def _deviation(turn: Turn, n: int) -> float:
    if abs(turn.sweep / n) >= 1.5:
        return float("inf")
    return grown(turn.radius, sqrt(1.0 + 0.25 * _alpha(turn, n) ** 4), turn.sweep / n, n)


def _corners(turn: Turn, n: int) -> Iterator[complex]:
    alpha = _alpha(turn, n)
    return rotated(turn, complex(1.0 - 0.5 * alpha * alpha, alpha), n - 1)


METHOD = Method("taylor", lambda R: sqrt(8.0 / R), _deviation, _corners)


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows (mm, mm/s, mm/s²) every `T` s; see `rds.interpolators.reference_word`."""
    return reference_word.interpolate(segment, T, params, METHOD)
