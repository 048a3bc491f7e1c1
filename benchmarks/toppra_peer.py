"""The least time along the pieces of a planned path by toppra, in a process of its own.

    python -m benchmarks.toppra_peer FILE.npz

reads what `benchmarks.motion` wrote: the floats and whole numbers of the pieces (pieces.py), edges of a grid, and the
limits of the axes; and prints JSON: version, seconds. Needs numpy and toppra, not rds.
"""

from __future__ import annotations

import json
import sys
from importlib.metadata import version
from typing import Any

import numpy as np
import toppra  # type: ignore[import-not-found]
import toppra.algorithm  # type: ignore[import-not-found]
import toppra.constraint  # type: ignore[import-not-found]
from toppra.interpolator import AbstractGeometricPath  # type: ignore[import-not-found]

LENGTH, FEED, SHAPE = 0, 1, 3  # columns of pieces.py
BLENDED, CIRCULAR = 2, 1
MOST = 1e4  # mm/s, for rapids


class Pieces(AbstractGeometricPath):  # type: ignore[misc]
    """The axes that move over q, and as one more the way itself, whose velocity is the feed."""

    def __init__(self, f: np.ndarray, u: np.ndarray, axes: np.ndarray):
        self._f, self._u, self._axes = f, u, axes
        self._at = np.concatenate(([0.0], np.cumsum(f[:, LENGTH])))

    def piece(self, q: float) -> int:
        return int(np.clip(np.searchsorted(self._at, q, side="right") - 1, 0, len(self._f) - 1))

    def feed(self, q: float) -> float:
        return float(min(self._f[self.piece(q), FEED], MOST))

    def __call__(self, q: Any, order: int = 0) -> np.ndarray:
        if np.ndim(q):
            return np.array([self(each, order) for each in q])
        k = self.piece(float(q))
        f, (kind, _, _, _, one, two), t = self._f[k], self._u[k], float(q) - self._at[k]
        rows = f[SHAPE : SHAPE + 36].reshape(6, 6)
        if kind == BLENDED:
            powers = [np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyder(rows, order))]
            value = np.asarray(powers[0])
        else:
            value = (rows[0] + rows[1] * t, rows[1].copy(), np.zeros(6))[order]
            if kind == CIRCULAR:
                x, y, turn = rows[2, :3]
                c, s = np.cos(turn * t), np.sin(turn * t)
                arm = ((c * x - s * y - x, s * x + c * y - y), (-s * x - c * y, c * x - s * y))
                arm = (*arm, (-c * x + s * y, -s * x - c * y))
                value[[one, two]] += np.array(arm[order]) * turn**order
        return np.append(value[self._axes], (t, 1.0, 0.0)[order])

    @property
    def dof(self) -> int:
        return int(self._axes.sum()) + 1

    @property
    def path_interval(self) -> np.ndarray:
        return self._at[[0, -1]]

    @property
    def waypoints(self) -> tuple[np.ndarray, np.ndarray]:
        return self._at, self(self._at)


def main() -> None:
    given = np.load(sys.argv[1])
    toppra.setup_logging("ERROR")
    axes, ends, edges = given["axes"], np.flatnonzero(given["u"][:, 3]) + 1, given["edges"]
    seconds, first, grid = 0.0, 0, 0
    for end in ends:
        f, u = given["f"][first:end], given["u"][first:end]
        path = Pieces(f, u, axes)
        count = int(given["counts"][first:end].sum())
        points = np.concatenate(([0.0], np.cumsum(edges[grid : grid + count])))
        points[-1] = path.path_interval[1]
        velocity = given["velocity"][axes]

        def fastest(q: float, path: Pieces = path, velocity: np.ndarray = velocity) -> np.ndarray:
            both = np.append(velocity, path.feed(q))
            return np.column_stack((-both, both))

        speed = toppra.constraint.JointVelocityConstraintVarying(fastest)
        most = np.append(given["acceleration"][axes], 1e9)
        push = toppra.constraint.JointAccelerationConstraint(np.column_stack((-most, most)))
        push.set_discretization_type(toppra.constraint.DiscretizationType.Interpolation)
        found = toppra.algorithm.TOPPRA([speed, push], path, gridpoints=points)
        _, v, _ = found.compute_parameterization(0.0, 0.0)
        seconds += float((2.0 * np.diff(points) / (v[1:] + v[:-1])).sum())
        first, grid = int(end), grid + count
    print(json.dumps({"version": f"toppra {version('toppra')}", "seconds": seconds}))


if __name__ == "__main__":
    main()
