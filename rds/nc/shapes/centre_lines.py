"""The centre lines of filled shapes: where a cutter engraves a stroke in one pass."""

from __future__ import annotations

import numpy as np

from rds.core.errors import InputError
from rds.nc.paths.needs import needed
from rds.nc.shapes.curves import Curve

MOST_CELLS = 16_000_000


def centre_lines(curves: list[Curve], cell: float, tolerance: float) -> list[np.ndarray]:
    """The centre lines (n × 2, mm each) of the area within the closed curves (even-odd), found on a grid of `cell` mm.

    The skeleton of the area (Zhang and Suen, scikit-image's `skeletonize`), as polylines from end or branching to end
    or branching, from which points are left out within `tolerance` mm (Douglas and Peucker). A line is off the true
    middle by up to about a cell. InputError without closed curves, and for a grid of more than 16 million cells.
    """
    closed = [curve for curve in curves if curve.closed and len(curve.points) > 2]
    if not closed:
        raise InputError(
            "centre lines are of filled shapes, and there is no closed curve here; engrave the curves themselves"
        )
    low = np.min([curve.points.min(axis=0) for curve in closed], axis=0) - 2 * cell
    high = np.max([curve.points.max(axis=0) for curve in closed], axis=0) + 2 * cell
    shape = tuple(int(n) for n in np.ceil((high - low) / cell))[::-1]
    if shape[0] * shape[1] > MOST_CELLS:
        raise InputError(f"a grid of {cell:g} mm has {shape[0]} × {shape[1]} cells; take a larger one")
    filled = np.zeros(shape, bool)
    polygon = needed("skimage.draw").polygon
    for curve in closed:
        rows, columns = polygon(*((curve.points - low) / cell - 0.5).T[::-1], shape)
        filled[rows, columns] ^= True
    skeleton = needed("skimage.morphology").skeletonize(filled)
    simplify = needed("skimage.measure").approximate_polygon
    lines = [simplify(line.astype(float), tolerance / cell) for line in _walked(skeleton)]
    return [(line[:, ::-1] + 0.5) * cell + low for line in lines if len(line) > 1]


def _walked(skeleton: np.ndarray) -> list[np.ndarray]:
    """The pixels of a skeleton in the order in which a tool passes them, shape (n, 2) each."""
    left = {tuple(place) for place in np.argwhere(skeleton).tolist()}
    around = [(-1, 0), (0, 1), (1, 0), (0, -1), (-1, -1), (-1, 1), (1, 1), (1, -1)]

    def neighbours(place: tuple[int, ...]) -> list[tuple[int, ...]]:
        found = [(place[0] + i, place[1] + j) for i, j in around if (place[0] + i, place[1] + j) in left]
        straight = [n for n in found if n[0] == place[0] or n[1] == place[1]]
        # a diagonal that is reached by a straight step as well is no branch of its own
        return [
            n for n in found if n in straight or not any(abs(n[0] - s[0]) + abs(n[1] - s[1]) == 1 for s in straight)
        ]

    degree = {place: len(neighbours(place)) for place in left}
    nodes = {place for place, count in degree.items() if count != 2}
    done: set[tuple[tuple[int, ...], tuple[int, ...]]] = set()
    found: list[np.ndarray] = []
    seen: set[tuple[int, ...]] = set()

    def follow(first: tuple[int, ...], second: tuple[int, ...]) -> None:
        line, before, here = [first], first, second
        done.add((first, second))
        while True:
            line.append(here)
            seen.add(here)
            onward = [n for n in neighbours(here) if n != before]
            if here in nodes or here == first or not onward:
                done.add((here, before))
                break
            before, here = here, onward[0]
        seen.add(first)
        found.append(np.array(line))

    for node in sorted(nodes):
        for second in neighbours(node):
            if (node, second) not in done:
                follow(node, second)
    for place in sorted(left - nodes):
        if place not in seen and (around_it := neighbours(place)):
            follow(place, around_it[0])
    return found
