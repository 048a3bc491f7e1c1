"""How far positions are from the programmed path, all axes counted."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from rds.core.types import ArcSegment, Segment
from rds.interpolators.segment import Arc


def distances(segment: Segment, positions: np.ndarray) -> np.ndarray:
    """Distance (mm) of each row of `positions` (shape (rows, axes)) from the segment, which ends at its ends.

    For an arc it is taken to the point of the path at the same angle: the nearest one, but for steep helices.
    """
    return np.linalg.norm(positions - nearest_points(segment, positions), axis=1)


def nearest_points(segment: Segment, positions: np.ndarray) -> np.ndarray:
    """The points of the segment (rows, axes), mm, that `distances` measures to."""
    if isinstance(segment, ArcSegment):
        arc = Arc.of(segment)
        return arc.points(_share(arc, segment, positions))
    start, way = np.array(segment.start), np.subtract(segment.end, segment.start)
    share = np.clip((positions - start) @ way / max(float(way @ way), 1e-300), 0.0, 1.0)
    return start + np.outer(share, way)


def path_distances(
    segments: Sequence[Segment], positions: np.ndarray, first: np.ndarray, last: np.ndarray
) -> np.ndarray:
    """Distance (mm) of each row from the nearest of the segments `first[row]` to `last[row]` (indices)."""
    found = np.full(len(positions), np.inf)
    for index, segment in enumerate(segments):
        # both do not fall from row to row
        rows = slice(int(np.searchsorted(last, index, "left")), int(np.searchsorted(first, index, "right")))
        if rows.start < rows.stop:
            found[rows] = np.minimum(found[rows], distances(segment, positions[rows]))
    return found


def path_deviations(
    segments: Sequence[Segment], positions: np.ndarray, first: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The nearest points of those segments, and the way from them to each row: both (rows, axes), mm."""
    nearest, found = positions.copy(), np.full(len(positions), np.inf)
    for index, segment in enumerate(segments):
        rows = slice(int(np.searchsorted(last, index, "left")), int(np.searchsorted(first, index, "right")))
        if rows.start < rows.stop:
            points = nearest_points(segment, positions[rows])
            far = np.linalg.norm(positions[rows] - points, axis=1)
            closer = far < found[rows]
            found[rows] = np.where(closer, far, found[rows])
            nearest[rows] = np.where(closer[:, None], points, nearest[rows])
    return nearest, positions - nearest


def _share(arc: Arc, segment: ArcSegment, positions: np.ndarray) -> np.ndarray:
    i, j = segment.plane
    arms = (positions[:, i] - segment.centre[i]) + 1j * (positions[:, j] - segment.centre[j])
    turned = np.angle(arms / arc.arm) * np.sign(arc.sweep) % (2 * pi)  # 0 to 360°, the way the arc goes
    whole = abs(arc.sweep)
    beyond = turned > whole
    back = beyond & (2 * pi - turned < turned - whole)  # nearer to the start than to the end
    share = np.where(back, 0.0, np.where(beyond, 1.0, turned / whole))
    # of a full circle and more, start and end are at one angle: the row itself says which, by its other axes
    return _closer_end(arc, positions, share)


def _closer_end(arc: Arc, positions: np.ndarray, share: np.ndarray) -> np.ndarray:
    here = np.linalg.norm(positions - arc.points(share), axis=1)
    for end in (0.0, 1.0):
        there = np.linalg.norm(positions - arc.points(np.array([end])), axis=1)
        share = np.where(there < here, end, share)
        here = np.minimum(here, there)
    return share
