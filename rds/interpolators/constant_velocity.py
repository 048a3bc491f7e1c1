"""The default of mini-cnc-rds: lines and arcs at constant velocity (`linear.py`, `circular.py`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rds.core.quantities import Quantity
from rds.core.types import ArcSegment, Segment
from rds.interpolators import circular, linear

OPTIONS: Mapping[str, Quantity] = {}


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows of a LineSegment or an ArcSegment (mm, mm/s, mm/s²) every `T` s."""
    method = circular if isinstance(segment, ArcSegment) else linear
    yield from method.interpolate(segment, T, params)
