"""A spline as chords: places on a NURBS, near enough to each other."""

from __future__ import annotations

import numpy as np

CURVE_ERROR = 0.001  # mm: a spline becomes chords that are no further from it
MOST_CHORDS = 4096  # between two knots


def curve(points: np.ndarray, order: int, error: float) -> np.ndarray:
    """Places (n, 2) on a NURBS with control points (n, 3: x, y, weight), whose chords are within `error` of it.

    Its knots are evenly spaced and `order`-fold at both ends (LinuxCNC's), evaluated by de Boor's recurrence. Where the
    knots are more than 100 m apart the chords may be further away.
    """
    count = len(points)
    spans = count - order + 1
    knots = np.concatenate([np.zeros(order - 1), np.arange(spans + 1), np.full(order - 1, float(spans))])
    weighted = np.column_stack([points[:, :2] * points[:, 2:], points[:, 2]])
    chords = 8 * spans
    while True:
        where = np.linspace(0.0, float(spans), 2 * chords + 1)
        found = _de_boor(weighted, knots, order, where)
        middles = 0.5 * (found[:-2:2] + found[2::2])
        if np.hypot(*(found[1::2] - middles).T).max() <= error or chords >= MOST_CHORDS * spans:
            return found[::2]
        chords *= 2


def _de_boor(weighted: np.ndarray, knots: np.ndarray, order: int, where: np.ndarray) -> np.ndarray:
    spans = np.clip(np.searchsorted(knots, where, side="right") - 1, order - 1, len(weighted) - 1)
    found = weighted[spans[:, None] + np.arange(1 - order, 1)]
    for level in range(1, order):
        for j in range(order - 1, level - 1, -1):
            low = knots[spans + 1 - order + j]
            part = ((where - low) / (knots[spans + 1 + j - level] - low))[:, None]
            found[:, j] = (1.0 - part) * found[:, j - 1] + part * found[:, j]
    return found[:, -1, :2] / found[:, -1, 2:]
