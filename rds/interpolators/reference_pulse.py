"""Reference pulse: positions in whole BLU (basic length units), the remainder of each sample carried to the next.

How many BLU an axis moves in a sample is a whole number; what is left is smaller than a BLU and would be lost, sample
after sample (dcs-thesis, section 6.6), so it is carried: the position after a sample is the whole BLU nearest to the
theoretical one, counted from zero. Commanded and theoretical position never differ by more than half a BLU, however
long the path.

The theoretical path is that of `constant_velocity.py`; velocity and acceleration are the theoretical ones. (The
circle of dcs-thesis, eq. 6.11 and 6.12, with cos Δθ ≅ 1, is Euler's: see `euler.py`.)
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from rds.core.quantities import Quantity
from rds.core.types import Segment
from rds.interpolators import constant_velocity

BLU = 0.01  # mm: dcs-thesis, eq. 5.1
OPTIONS: Mapping[str, Quantity] = {"blu": Quantity("basic length unit", "mm", above=0.0)}
DEFAULTS = {"blu": BLU}


def theory(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """The rows whose positions are then made whole."""
    return constant_velocity.interpolate(segment, T, {})


def interpolate(segment: Segment, T: float, params: Mapping[str, Any]) -> Iterator[tuple[np.ndarray, ...]]:
    """Rows (mm, mm/s, mm/s²) every `T` s, positions in whole BLU."""
    return in_whole_blu(theory(segment, T, params), float(params.get("blu", BLU)))


def in_whole_blu(rows: Iterable[tuple[np.ndarray, ...]], blu: float) -> Iterator[tuple[np.ndarray, ...]]:
    """The rows with each position (mm) at the nearest whole `blu` (mm)."""
    for position, velocity, acceleration in rows:
        yield np.rint(position / blu) * blu, velocity, acceleration


def pulses(positions: np.ndarray, blu: float) -> np.ndarray:
    """Whole BLU of each sample and axis, shape (samples, axes), for theoretical positions (samples + 1, axes), mm."""
    return np.diff(np.rint(positions / blu).astype(np.int64), axis=0)


def pulses_without_carry(positions: np.ndarray, blu: float) -> np.ndarray:
    """The same with each sample's remainder dropped, N = int{Δ}: what section 6.6 warns of."""
    return np.trunc(np.diff(positions, axis=0) / blu).astype(np.int64)


def generation_error(positions: np.ndarray, commands: np.ndarray, blu: float) -> np.ndarray:
    """Commanded minus theoretical position (mm, shape (samples + 1, axes)), from pulses as a module decodes them.

    The commands are summed up from the whole BLU where the path starts (dcs-thesis, figure 6.7).
    """
    sent = np.rint(positions[0] / blu).astype(np.int64) + np.vstack([np.zeros_like(commands[:1]), commands]).cumsum(0)
    return sent * blu - positions
