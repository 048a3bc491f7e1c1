"""How far samples are from the programmed path, from the segments alone."""

from __future__ import annotations

import numpy as np

from rds.interpolators.motion.segments import BLEND, XY, YZ, ZX, in_plane

NEIGHBOURS = (0, -1, 1, -2, 2)  # segments, counted from a sample's own, in which its nearest point may be
ON = 1e-9  # mm or degrees: nearer is on the path


def deviation(position: np.ndarray, path: np.ndarray, segment: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Distance of positions (m, 6) to the nearest of the segments about `segment` (indices into `path`), (m).

    The larger of that in X, Y, Z (mm) and that in A, B, C (degrees). share (m): how far along its segment a sample is
    (0 to 1), which says which turn of a helix it belongs to.
    """
    nearest = np.full(len(position), np.inf)
    for step in NEIGHBOURS:
        k = segment + step
        inside = (k >= 0) & (k < len(path)) & (nearest > ON)
        if not inside.any():
            continue
        rows, points = path[k[inside]], position[inside]
        turn = share[inside] if step == 0 else np.full(len(rows), float(step < 0))
        nearest[inside] = np.minimum(nearest[inside], _gap(points, _closest(rows, points, turn)))
    return nearest


def allowed(path: np.ndarray, tolerance: float) -> np.ndarray:
    """mm or degrees by which the motion may leave each segment: the larger of P (or `tolerance`) and Q of G64, or 0."""
    cut = np.maximum(np.where(np.isfinite(path["tolerance"]), path["tolerance"], tolerance), path["collinear"])
    return np.where(path["mode"] == BLEND, cut, 0.0)


def _gap(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    away = a - b
    return np.maximum(np.linalg.norm(away[:, :3], axis=1), np.linalg.norm(away[:, 3:], axis=1))


def _closest(rows: np.ndarray, points: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """The point of each row's segment that is closest to each of the points."""
    start, way = rows["start"], rows["end"] - rows["start"]
    size = np.einsum("ij,ij->i", way, way)
    along = np.einsum("ij,ij->i", points - start, way) / np.where(size > 0.0, size, 1.0)
    found = start + way * np.clip(along, 0.0, 1.0)[:, None]
    for plane in (XY, ZX, YZ):
        arcs = np.flatnonzero(rows["plane"] == plane)
        if len(arcs):
            found[arcs] = _closest_on_arcs(rows[arcs], points[arcs], turn[arcs], plane)
    return found


def _closest_on_arcs(rows: np.ndarray, points: np.ndarray, turn: np.ndarray, plane: int) -> np.ndarray:
    first, second, _ = in_plane(plane)
    start, end, centre, sweep = rows["start"], rows["end"], rows["centre"], rows["sweep"]
    x, y = start[:, first] - centre[:, first], start[:, second] - centre[:, second]
    u, v = points[:, first] - centre[:, first], points[:, second] - centre[:, second]
    angle = np.arctan2(x * v - y * u, x * u + y * v)
    angle = angle + 2 * np.pi * np.round((turn * sweep - angle) / (2 * np.pi))
    share = np.clip(angle / sweep, 0.0, 1.0)

    def turned(angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lost = 2.0 * np.sin(0.5 * angle) ** 2
        return -np.sin(angle) * y - lost * x, np.sin(angle) * x - lost * y

    way = end - start  # what is linear along it: the rest, and in the plane how far the end is off the circle
    all_1, all_2 = turned(sweep)
    way[:, first] -= all_1
    way[:, second] -= all_2
    for _ in range(3):  # the nearest angle is nearly the nearest point; Newton's steps find it
        to_1, to_2 = turned(share * sweep)
        found = start + way * share[:, None]
        found[:, first] += to_1
        found[:, second] += to_2
        slope = way.copy()
        slope[:, first] -= sweep * (y + to_2)
        slope[:, second] += sweep * (x + to_1)
        size = np.einsum("ij,ij->i", slope, slope)
        step = np.einsum("ij,ij->i", points - found, slope) / np.where(size > 0.0, size, 1.0)
        share = np.clip(share + step, 0.0, 1.0)
    return found
