"""The centre lines of filled shapes: where a cutter engraves a stroke in one pass."""

from __future__ import annotations

import numpy as np

from rds.core.errors import InputError
from rds.nc.paths.needs import needed
from rds.nc.shapes.curves import Curve

MOST_CELLS = 16_000_000
SMOOTHED = 3.0  # cells: standard deviation of the Gaussian that takes the grid's steps out of a line
LOOKED = 8  # pixels from a branching, over which a line's direction is taken


def centre_lines(curves: list[Curve], cell: float, tolerance: float) -> list[np.ndarray]:
    """The centre lines (n × 2, mm each) of the area within the closed curves (even-odd), found on a grid of `cell` mm.

    The skeleton of the area (Zhang and Suen, scikit-image's `skeletonize`), as polylines from end to end that go
    straight on through branchings where they can, so that the tool lifts seldom. The grid's steps are smoothed out
    along their length, and points are left out within `tolerance` mm (Douglas and Peucker). A line is off the true
    middle by up to about a cell, and rounds its corners. InputError without closed curves, and for a grid of more than
    16 million cells.
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
    lines = [simplify(_smoothed(line.astype(float)), tolerance / cell) for line in _joined(_walked(skeleton))]
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


def _joined(lines: list[np.ndarray]) -> list[np.ndarray]:
    """Lines that meet at a branching made one, in pairs, the straightest first, where they turn by less than 90°."""
    meeting: dict[tuple[int, ...], list[tuple[int, bool]]] = {}  # of each place the lines, and whether it is their end
    for k, line in enumerate(lines):
        if (line[0] != line[-1]).any():
            meeting.setdefault(tuple(line[0].tolist()), []).append((k, False))
            meeting.setdefault(tuple(line[-1].tolist()), []).append((k, True))
    joins: dict[tuple[int, bool], tuple[int, bool]] = {}
    for ends in meeting.values():
        ways = [_direction(lines[k], last) for k, last in ends]
        turns = [
            (float(ways[i] @ ways[j]), i, j) for j in range(len(ends)) for i in range(j) if ends[i][0] != ends[j][0]
        ]
        for turn, i, j in sorted(turns):
            if turn < 0.0 and ends[i] not in joins and ends[j] not in joins:
                joins[ends[i]], joins[ends[j]] = ends[j], ends[i]
    found: list[np.ndarray] = []
    left = set(range(len(lines)))
    ends_first = sorted(left, key=lambda k: (k, False) in joins and (k, True) in joins)
    for first in ends_first:  # then those that are joined into rings
        if first not in left:
            continue
        k, backwards = first, (first, False) in joins and (first, True) not in joins
        whole: list[np.ndarray] = []
        while k in left:
            left.discard(k)
            part = lines[k][::-1] if backwards else lines[k]
            whole.append(part[1:] if whole else part)
            onward = joins.get((k, not backwards))
            if onward is None:
                break
            k, backwards = onward
        found.append(np.concatenate(whole))
    return found


def _direction(line: np.ndarray, last: bool) -> np.ndarray:
    """Of unit length, from one end of a line into it."""
    inwards = line[::-1] if last else line
    way = (inwards[min(LOOKED, len(line) - 1)] - inwards[0]).astype(float)
    return way / np.hypot(*way)


def _smoothed(line: np.ndarray) -> np.ndarray:
    """A line of pixels without their steps; its ends stay where they are, and a ring closed."""
    reach = int(3 * SMOOTHED)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / SMOOTHED) ** 2)
    weights /= weights.sum()
    if (line[0] == line[-1]).all():
        ring = np.pad(line[:-1], ((reach, reach), (0, 0)), "wrap")
        smooth = np.column_stack([np.convolve(column, weights, "valid") for column in ring.T])
        return np.vstack((smooth, smooth[:1]))
    mirrored = np.pad(line, ((reach, reach), (0, 0)), "reflect", reflect_type="odd")
    return np.column_stack([np.convolve(column, weights, "valid") for column in mirrored.T])
