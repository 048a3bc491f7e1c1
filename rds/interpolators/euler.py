"""Euler: A = 1, B = α. A step turns by atan α, and makes the radius √(1 + α²) times longer: errors add up.

For one BLU of radial error after a quadrant α = 4/(π R), R in BLU. The count of mrm-control (56 steps for R = 100 mm)
is that of the chord height alone, α = √(8/R), with which the radial error is many BLU.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import atan, cos, sqrt, tan
from typing import Any

import numpy as np

from rds.core.types import Segment
from rds.interpolators import reference_word
from rds.interpolators.division import Method, Turn, grown, grown_nearest, rotated

OPTIONS, DEFAULTS = reference_word.OPTIONS, reference_word.DEFAULTS


def _alpha(turn: Turn, n: int) -> float:
    return tan(turn.sweep / n)


def _deviation(turn: Turn, n: int) -> float:
    angle = turn.sweep / n
    return grown(turn.radius, 1.0 / cos(angle), angle, n) if abs(angle) < 1.5 else float("inf")


def _corners(turn: Turn, n: int) -> Iterator[complex]:
    return rotated(turn, complex(1.0, _alpha(turn, n)), n - 1)


def _inside(turn: Turn, n: int) -> float:
    angle = turn.sweep / n
    return turn.radius * (1.0 - grown_nearest(1.0 / cos(angle), angle)) if n > 1 else _deviation(turn, n)


METHOD = Method("euler", lambda R: atan(sqrt(8.0 / R)), _deviation, _corners, inside=_inside)


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows (mm, mm/s, mm/s²) every `T` s; see `rds.interpolators.reference_word`."""
    return reference_word.interpolate(segment, T, params, METHOD)
