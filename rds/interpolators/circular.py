"""Circular and helical moves at constant speed: x = R cos θ(t), y = R sin θ(t), θ(t) = θ₀ ± V t / R.

Position, velocity and acceleration are those of the circle itself (oacs-thesis, eq. 7.32 to 7.34), at a speed that
makes the move a whole number of samples: N = ⌈L / (F T)⌉, V = L / (N T).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.types import ArcSegment, Segment
from rds.interpolators.linear import BLOCK
from rds.interpolators.segment import Arc, checked, samples

OPTIONS: Mapping[str, Quantity] = {}


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows of an ArcSegment (mm, mm/s, mm/s²) every `T` s. InputError for a line."""
    segment = checked(segment, T)
    if not isinstance(segment, ArcSegment):
        raise InputError("the circular interpolator takes arcs only; use constant-velocity or linear")
    arc, N = Arc.of(segment), samples(segment, T)
    for first in range(1, N + 1, BLOCK):
        share = np.arange(first, min(first + BLOCK, N + 1)) / N
        positions, velocities, accelerations = arc.motion(share, N * T)
        if first + BLOCK > N:
            positions[-1] = segment.end
        yield from zip(positions, velocities, accelerations, strict=True)
