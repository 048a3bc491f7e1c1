"""How far two outlines are from each other: the Hausdorff distance, to a stated accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.nc.paths.needs import needed

ACCURACY = 1e-6  # mm
_MOST_PIECES = 20_000_000


def hausdorff(a: Sequence[np.ndarray], b: Sequence[np.ndarray], accuracy: float = ACCURACY) -> float:
    """The Hausdorff distance of two sets of polylines (each of shape (n, 2), mm), at most `accuracy` below the truth.

    The largest distance from a point of either to the nearest point of the other: over all their points, not only the
    corners (which is what shapely's `hausdorff_distance` looks at). Each piece is halved until it is certain that none
    of its points is farther than the farthest known one by more than the accuracy.
    """
    return max(_farthest(a, b, accuracy), _farthest(b, a, accuracy))


def _farthest(lines: Sequence[np.ndarray], others: Sequence[np.ndarray], accuracy: float) -> float:
    """The largest distance of a point of `lines` from `others`.

    Of a piece of a line it is at most that at its farther end, taken to any one straight piece of the other (the
    distance to which is convex), and at most the mean of its ends' distances plus half its length.
    """
    nearest = _Nearest(others)
    start = np.concatenate([line[:-1] for line in lines])
    end = np.concatenate([line[1:] for line in lines])
    d0, n0 = nearest(start)
    d1, n1 = nearest(end)
    best = float(max(d0.max(), d1.max()))
    pieces = len(start)
    while True:
        bound = np.minimum(np.maximum(d0, nearest.to(n0, end)), np.maximum(nearest.to(n1, start), d1))
        bound = np.minimum(bound, (d0 + d1 + np.linalg.norm(end - start, axis=1)) / 2)
        open_ones = bound > best + accuracy
        if not open_ones.any():
            return best
        start, end, d0, d1, n0, n1 = (values[open_ones] for values in (start, end, d0, d1, n0, n1))
        middle = (start + end) / 2
        dm, nm = nearest(middle)
        best = max(best, float(dm.max()))
        start, end = np.concatenate([start, middle]), np.concatenate([middle, end])
        d0, d1 = np.concatenate([d0, dm]), np.concatenate([dm, d1])
        n0, n1 = np.concatenate([n0, nm]), np.concatenate([nm, n1])
        pieces += len(start)
        if pieces > _MOST_PIECES:
            raise InputError("the outline is too long to measure its deviation; scale the drawing down")


class _Nearest:
    """Distance of points to the nearest of many straight pieces, and which that is."""

    def __init__(self, lines: Sequence[np.ndarray]):
        shapely: Any = needed("shapely")
        self.start = np.concatenate([line[:-1] for line in lines])
        self.step = np.concatenate([np.diff(line, axis=0) for line in lines])
        self.square = np.maximum((self.step * self.step).sum(axis=1), 1e-300)
        self.tree = shapely.STRtree(shapely.linestrings(np.stack([self.start, self.start + self.step], axis=1)))
        self.points = shapely.points

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances, and indices of the nearest pieces."""
        (_, which), distances = self.tree.query_nearest(self.points(points), all_matches=False, return_distance=True)
        return distances, which

    def to(self, which: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Distances of `points` to the pieces `which`, one each."""
        off = points - self.start[which]
        along = np.clip((off * self.step[which]).sum(axis=1) / self.square[which], 0.0, 1.0)
        return np.linalg.norm(off - along[:, None] * self.step[which], axis=1)
