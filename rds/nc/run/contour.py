"""The contour error: how far a measured position is from the programmed path, exactly, near where the motion is.

Only X, Y and Z count, in mm: a rotary axis that lags moves the point that it carries by an amount which depends on how
far out that is. Of moves programmed for the tool's tip, points and path are the tip's (judge.py), and it counts.
"""

from __future__ import annotations

from math import pi

import numpy as np

from rds.interpolators.motion.segments import LINE, in_plane

_CHUNK = 1024  # samples at a time: far from the path each has a thousand candidates of 200 bytes
_MOST = 512  # segments to either side
_STEPS = 40  # of Newton's method, at most
_GRID = 65  # places along a helix that are looked at first
_ARC_LENGTH = pi  # path between a point and its nearest neighbour, over twice the distance: half a circle at most


def contour_error(
    points: np.ndarray, path: np.ndarray, segment: np.ndarray, reach: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance (mm) of each of `points` (n × 3, mm) to `path` (array of SEGMENT), and the segment that is nearest.

    `segment` says in which segment the reference of each point was; `reach` (mm) how far from it the point may be: its
    following error and the tolerance of corners. Segments are looked at from π reach of path before that one to as
    much behind it. Lines and arcs are solved in closed form or by Newton's method to rounding.
    """
    error, nearest = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
    ends = np.cumsum(np.linalg.norm(path["end"][:, :3] - path["start"][:, :3], axis=1))
    arcs = path["plane"] != LINE
    if arcs.any():
        ends = np.cumsum(np.where(arcs, path["length"], np.diff(ends, prepend=0.0)))
    starts = np.concatenate(([0.0], ends[:-1]))
    for i in range(0, len(points), _CHUNK):
        part = slice(i, i + _CHUNK)
        at = segment[part]
        far = _ARC_LENGTH * reach[part]
        first = np.maximum(np.searchsorted(ends, starts[at] - far, "left"), np.maximum(at - _MOST, 0))
        last = np.minimum(np.searchsorted(starts, ends[at] + far, "right"), np.minimum(at + _MOST + 1, len(path)))
        first, last = np.minimum(first, at), np.maximum(last, at + 1)
        error[part], nearest[part] = _nearest(points[part], path, first, last)
    return error, nearest


def _nearest(
    points: np.ndarray, path: np.ndarray, first: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each point to the nearest of its segments first to last − 1, and which that is."""
    counts = last - first
    begins = np.concatenate(([0], np.cumsum(counts)[:-1]))
    point = np.repeat(np.arange(len(points)), counts)
    candidate = np.arange(counts.sum()) - np.repeat(begins, counts) + np.repeat(first, counts)
    distance = np.empty(len(candidate))
    is_arc = path["plane"][candidate] != LINE
    lines = ~is_arc
    distance[lines] = _to_lines(points[point[lines]], path[candidate[lines]])
    for plane in np.unique(path["plane"][candidate[is_arc]]):
        these = path["plane"][candidate] == plane
        distance[these] = _to_arcs(points[point[these]], path[candidate[these]], int(plane))
    least = np.minimum.reduceat(distance, begins)
    hits = np.flatnonzero(distance == np.repeat(least, counts))
    chosen = hits[np.unique(point[hits], return_index=True)[1]]
    return least, candidate[chosen]


def _to_lines(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    start = segments["start"][:, :3]
    way = segments["end"][:, :3] - start
    square = np.einsum("ij,ij->i", way, way)
    along = np.einsum("ij,ij->i", points - start, way)
    share = np.clip(np.divide(along, square, out=np.zeros_like(along), where=square > 0.0), 0.0, 1.0)
    off: np.ndarray = np.linalg.norm(points - start - share[:, None] * way, axis=1)
    return off


def _to_arcs(points: np.ndarray, segments: np.ndarray, plane: int) -> np.ndarray:
    """Arcs and helices of one plane: the share of the way that is nearest, by Newton's method from two sides."""
    order = list(in_plane(plane))
    start, end = segments["start"][:, order], segments["end"][:, order]
    arm = start[:, :2] - segments["centre"][:, order[:2]]
    point, sweep = points[:, order], segments["sweep"]
    off = end[:, :2] - start[:, :2] - _turned(arm, sweep)[0]
    rise = end[:, 2] - start[:, 2]

    def place(share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """From the point to the path, its first and its second derivative, at a share of the way."""
        turned, tangent, inward = _turned(arm, share * sweep)
        here = np.column_stack((start[:, :2] + turned + share[:, None] * off, start[:, 2] + share * rise))
        slope = np.column_stack((tangent * sweep[:, None] + off, rise))
        bend = np.column_stack((inward * (sweep**2)[:, None], np.zeros_like(rise)))
        return here - point, slope, bend

    best = np.minimum(np.linalg.norm(point - start, axis=1), np.linalg.norm(point - end, axis=1))
    spoke = point[:, :2] - segments["centre"][:, order[:2]]
    cross = arm[:, 0] * spoke[:, 1] - arm[:, 1] * spoke[:, 0]
    angle = np.arctan2(cross, np.einsum("ij,ij->i", arm, spoke)) * np.sign(sweep)
    climbed = np.divide(point[:, 2] - start[:, 2], rise, out=np.zeros_like(rise), where=rise != 0.0)
    turn, whole = 2.0 * pi, np.abs(sweep)
    lap = np.where(rise != 0.0, np.round((np.clip(climbed, 0.0, 1.0) * whole - angle) / turn), 0.0)
    starts = [np.clip((angle + (lap + more) * turn) / whole, 0.0, 1.0) for more in (-1.0, 0.0, 1.0)]
    if rise.any():  # a helix has nearest places in several turns, which its axis does not tell apart
        grid = np.linspace(0.0, 1.0, _GRID)
        far = np.array([np.linalg.norm(place(np.full(len(points), share))[0], axis=1) for share in grid])
        starts += [grid[order] for order in np.argsort(far, axis=0)[:2]]
    for share in starts:
        for _ in range(_STEPS):
            away, slope, bend = place(share)
            gradient = np.einsum("ij,ij->i", away, slope)
            square = np.einsum("ij,ij->i", slope, slope)
            curvature = square + np.einsum("ij,ij->i", away, bend)
            step = gradient / np.where(curvature > 0.02 * square, curvature, square)
            moved = np.clip(share - step, 0.0, 1.0)
            if np.abs(moved - share).max(initial=0.0) < 1e-15:
                break
            share = moved
        best = np.minimum(best, np.linalg.norm(place(share)[0], axis=1))
    return best


def _turned(arm: np.ndarray, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """By how much the arm's end moves when it turns by an angle, and the first two derivatives by the angle."""
    sine, cosine = np.sin(angle)[:, None], np.cos(angle)[:, None]
    lost = 2.0 * np.sin(angle / 2.0)[:, None] ** 2  # 1 − cos, without cancellation
    left = np.column_stack((-arm[:, 1], arm[:, 0]))
    return sine * left - lost * arm, cosine * left - sine * arm, -cosine * arm - sine * left
