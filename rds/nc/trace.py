"""A path as points to draw: lines by their ends, arcs and helices in short steps, one polyline per kind of move."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rds.interpolators.motion.segments import JOINTS, pieces, points_at
from rds.nc.extent import extents
from rds.nc.path_block import PathBlock

RAPID, STRAIGHT, CURVED = 0, 1, 2
STEP = 0.04  # rad of an arc from point to point
MOST_POINTS = 500_000  # more are thinned out
_FINEST, _COARSEST = 1 / 20000, 1 / 400  # of the path's size, what they are thinned out to


class Trace:
    """The points of a program: `points[kind]` n × 3 (X Y Z, mm, machine), nan rows between separate polylines.

    `resolution` is what points were thinned out to, mm (0: none were): memory does not grow with the number of lines.
    """

    def __init__(self) -> None:
        self.resolution = 0.0
        self.low, self.high = np.full(6, np.inf), np.full(6, -np.inf)
        self.start = np.zeros(3)
        self.end = np.zeros(3)
        self._kept: dict[int, list[np.ndarray]] = {RAPID: [], STRAIGHT: [], CURVED: []}
        self.of_tip = False  # X, Y, Z are the tool's tip on the work, at least of some of it
        self._count = 0
        self._last = -1

    @classmethod
    def of(cls, blocks: Iterable[PathBlock]) -> Trace:
        """The trace of a whole path."""
        trace = cls()
        for block in blocks:
            trace.add(block.segments)
        return trace

    @property
    def points(self) -> dict[int, np.ndarray]:
        """By kind of move; a kind that does not occur has no points."""
        return {kind: np.concatenate([np.zeros((0, 3)), *kept]) for kind, kept in self._kept.items()}

    def add(self, segments: np.ndarray) -> None:
        """Append segments (dtype SEGMENT)."""
        if not len(segments):
            return
        self.of_tip |= bool((segments["tip"] != JOINTS).any())
        kinds = np.where(segments["rapid"], RAPID, np.where(segments["plane"] >= 0, CURVED, STRAIGHT))
        before = np.concatenate(([self._last], kinds[:-1]))
        points, owner = sample(segments)
        for kind, kept in self._kept.items():
            mine = kinds == kind
            if not mine.any():
                continue
            fresh = np.flatnonzero(mine & (before != kind))  # these begin a polyline: a gap, and where they start
            chosen = mine[owner]
            found, of = points[chosen], owner[chosen]
            gap = np.searchsorted(of, fresh)
            starts = np.stack((np.full((len(fresh), 3), np.nan), segments["start"][fresh, :3]), axis=1)
            kept.append(np.insert(found, np.repeat(gap, 2), starts.reshape(-1, 3), axis=0))
            self._count += len(kept[-1])
        low, high = extents(segments)
        self.low, self.high = np.fmin(self.low, low.min(axis=0)), np.fmax(self.high, high.max(axis=0))
        if self._last < 0:
            self.start = segments["start"][0, :3].copy()
        self._last, self.end = int(kinds[-1]), segments["end"][-1, :3].copy()
        if self._count > MOST_POINTS:
            self._thin_out()

    def _thin_out(self) -> None:
        """Leave points away that are nearer to the one before than a fraction of the path, a coarser one each time."""
        span = float(np.max(self.high[:3] - self.low[:3])) or 1.0
        while self._count > MOST_POINTS / 2 and self.resolution < span * _COARSEST / 2:
            self.resolution = max(2 * self.resolution, span * _FINEST)
            for kind, kept in self._kept.items():
                self._kept[kind] = [_thinned(np.concatenate(kept), self.resolution)] if kept else []
            self._count = sum(len(part) for kept in self._kept.values() for part in kept)


def _thinned(points: np.ndarray, resolution: float) -> np.ndarray:
    cells = np.nan_to_num(np.round(points / resolution), nan=np.inf)
    keep = np.ones(len(points), bool)
    keep[1:-1] = np.any(cells[1:-1] != cells[:-2], axis=1)
    return points[keep]


def sample(segments: np.ndarray, step: float = STEP) -> tuple[np.ndarray, np.ndarray]:
    """Points along segments after their starts (n × 3, X Y Z), and to which segment each belongs."""
    curved = segments["plane"] >= 0
    counts = np.where(curved, np.ceil(np.abs(segments["sweep"]) / step), 1).astype(int).clip(1)
    owner, share = pieces(counts)
    return points_at(segments[owner], share)[:, :3], owner
