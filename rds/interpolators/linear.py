"""Straight moves at constant velocity.

The move takes a whole number of samples, N = ⌈L / (F T)⌉, and its velocity is L / (N T): the feed rate F or, so that
the last sample is on the end, a little less. All axes start and arrive together (oacs-thesis, section 7.4.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.types import LineSegment, Segment
from rds.interpolators.segment import checked, samples

OPTIONS: Mapping[str, Quantity] = {}
BLOCK = 512  # rows that are worked out at once


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows of a LineSegment (mm, mm/s, mm/s²) every `T` s; none for a line without length. InputError for an arc."""
    segment = checked(segment, T)
    if not isinstance(segment, LineSegment):
        raise InputError("the linear interpolator takes straight moves only; use constant-velocity or circular")
    start, way = np.array(segment.start), np.subtract(segment.end, segment.start)
    N = samples(segment, T)
    still = np.zeros(len(start))
    for first in range(1, N + 1, BLOCK):
        share = np.arange(first, min(first + BLOCK, N + 1)) / N
        positions = start + np.outer(share, way)
        if first + BLOCK > N:
            positions[-1] = segment.end
        for position in positions:
            yield position, way / (N * T), still
