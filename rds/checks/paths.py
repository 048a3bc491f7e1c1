"""Where a segment's path runs, and how far the rows of an interpolator are from it."""

from __future__ import annotations

import numpy as np

from rds.core.geometry import radius, sweep
from rds.core.types import ArcSegment, LineSegment, Segment

FEED = 20.0  # mm/s
LINE = LineSegment((1.0, 2.0), (9.0, -4.0), FEED)
LINE_BACK = LineSegment((-3.0, 1.0), (-7.0, 4.0), FEED)
LINE_OF_ONE = LineSegment((4.0,), (-3.0,), FEED)
LINE_OF_THREE = LineSegment((1.0, 2.0, -1.0), (5.0, -4.0, 3.0), FEED)
ARC = ArcSegment((7.0, 1.0), (2.0, 6.0), (2.0, 1.0), FEED)
CLOCKWISE = ArcSegment((7.0, 1.0), (2.0, 6.0), (2.0, 1.0), FEED, clockwise=True)
CIRCLE = ArcSegment((4.0, 1.0), (4.0, 1.0), (2.0, 1.0), FEED)


def name_of(segment: Segment) -> str:
    """For a message: "an ArcSegment (clockwise, 270°)"."""
    if isinstance(segment, LineSegment):
        n = len(segment.start)
        return f"a LineSegment of {n} {'axes' if n > 1 else 'axis'}"
    direction = "clockwise" if segment.clockwise else "counter-clockwise"
    return f"an ArcSegment ({direction}, {abs(np.degrees(sweep(segment))):.0f}°)"


def swept(segment: ArcSegment, positions: np.ndarray) -> float:
    """Angle that the rows of `positions` (shape (rows, axes), mm) go round the centre from the start, rad."""
    points = np.vstack([segment.start, positions])[:, list(segment.plane)]
    x, y = (points - np.asarray(segment.centre)[list(segment.plane)]).T
    angles = np.unwrap(np.arctan2(y, x))
    return float(angles[-1] - angles[0])


def distances(segment: Segment, positions: np.ndarray) -> np.ndarray:
    """Distance of each row of `positions` (shape (rows, axes), mm) from the line, or from the circle in its plane."""
    if isinstance(segment, LineSegment):
        return chord_distances(segment, positions)
    i, j = segment.plane
    return np.abs(np.hypot(positions[:, i] - segment.centre[i], positions[:, j] - segment.centre[j]) - radius(segment))


def chord_distances(segment: Segment, positions: np.ndarray) -> np.ndarray:
    """Distance of each row from the straight piece between start and end, mm."""
    start = np.asarray(segment.start)
    chord = np.asarray(segment.end) - start
    along = np.clip((positions - start) @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0)
    return np.linalg.norm(positions - start - along[:, None] * chord, axis=1)
