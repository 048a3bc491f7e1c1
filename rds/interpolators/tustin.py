"""Tustin: A = (1 - (α/2)²) / (1 + (α/2)²), B = α / (1 + (α/2)²). A² + B² = 1: the corners are on the circle.

There is no radial error, and the chord height is one BLU for α = √(8/R), R in BLU.
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


def factor(angle: float) -> complex:
    """A + i B of a step that turns by `angle` rad."""
    half = tan(0.5 * angle)  # α/2
    return complex(1.0 - half * half, 2.0 * half) / (1.0 + half * half)


def _deviation(turn: Turn, n: int) -> float:
    return grown(turn.radius, 1.0, turn.sweep / n, n)


def _corners(turn: Turn, n: int) -> Iterator[complex]:
    return rotated(turn, factor(turn.sweep / n), n - 1)


METHOD = Method("tustin", lambda R: sqrt(8.0 / R), _deviation, _corners)


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows (mm, mm/s, mm/s²) every `T` s; see `rds.interpolators.reference_word`."""
    return reference_word.interpolate(segment, T, params, METHOD)
