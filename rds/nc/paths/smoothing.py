"""Smooth closed outlines that stay within a stated distance of the traced ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rds.core.errors import InputError
from rds.nc.paths.deviation import hausdorff
from rds.nc.paths.needs import needed

BLUR = 0.65  # of the tolerance; the rest is for leaving out points
_SMALLER = 0.85
_POINTS_PER_TOLERANCE = 4.0
_MOST_POINTS = 400_000


def smoothed(rings: Sequence[np.ndarray], tolerance: float, blur: float = BLUR) -> tuple[list[np.ndarray], float]:
    """Rings (closed, shape (n, 2), first point repeated, mm) smoothed, and their measured Hausdorff distance to these.

    Each ring is sampled evenly and blurred along its length by a Gaussian as wide as `blur` of the tolerance allows;
    with the rest points are left out (Douglas and Peucker). What comes out is measured against the traced rings, and
    made less smooth until it keeps within the tolerance and no ring crosses itself or another. InputError where even
    that does not help.
    """
    share = 1.0
    for _ in range(30):
        found = [
            _simplified(_blurred(ring, blur * share * tolerance, tolerance), (1 - blur) * share * tolerance)
            for ring in rings
        ]
        if are_simple(found):
            deviation = hausdorff(rings, found)
            if deviation <= tolerance:
                return found, deviation
        share *= _SMALLER
    raise InputError(
        f"the outline cannot be smoothed within {tolerance:g} mm without crossing itself; take a smaller tolerance"
    )


def are_simple(rings: Sequence[np.ndarray]) -> bool:
    """Whether no ring crosses or touches itself or another, the others lying within the first."""
    shapely = needed("shapely")
    return all(len(ring) >= 4 for ring in rings) and bool(shapely.Polygon(rings[0], rings[1:]).is_valid)


def _blurred(ring: np.ndarray, most: float, tolerance: float) -> np.ndarray:
    """The ring under the widest Gaussian that moves no sample by more than `most` (found by halving)."""
    samples = _evenly(ring, tolerance / _POINTS_PER_TOLERANCE)
    count = len(samples)
    # a Gaussian of σ samples around the closed ring: its spectrum times exp(-(2πfσ)²/2)
    spectrum = np.fft.rfft(samples, axis=0)
    exponent = -2 * (np.pi * np.fft.rfftfreq(count)) ** 2
    low, high = 0.0, count / 8
    best = samples
    for _ in range(24):
        width = (low + high) / 2
        if width < 0.3:  # samples: no blur to speak of
            break
        moved = np.fft.irfft(spectrum * np.exp(exponent * width**2)[:, None], n=count, axis=0)
        if np.linalg.norm(moved - samples, axis=1).max() <= most:
            low, best = width, moved
        else:
            high = width
    return np.vstack([best, best[:1]])


def _evenly(ring: np.ndarray, spacing: float) -> np.ndarray:
    """Points along the ring at equal distances, the first not repeated."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
    count = int(np.clip(np.ceil(along[-1] / spacing), 16, _MOST_POINTS))
    at = np.arange(count) * (along[-1] / count)
    return np.column_stack([np.interp(at, along, ring[:, 0]), np.interp(at, along, ring[:, 1])])


def _simplified(ring: np.ndarray, tolerance: float) -> np.ndarray:
    shapely = needed("shapely")
    return np.asarray(shapely.simplify(shapely.LineString(ring), tolerance, preserve_topology=True).coords)


def without_idle_points(ring: np.ndarray) -> np.ndarray:
    """The same ring without points on the straight way between their neighbours; it begins at a corner."""
    points = ring[:-1]
    while len(points) > 3:
        before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
        a, b = points - before, after - points
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        scale = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        idle = (np.abs(cross) <= 1e-12 * np.maximum(scale, 1e-300)) & ((a * b).sum(axis=1) >= 0)
        if not idle.any():
            break
        points = points[~idle]
    return np.vstack([points, points[:1]])
