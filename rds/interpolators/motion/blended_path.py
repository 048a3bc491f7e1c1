"""A program's motion as three-axis-mill coordinates it: `blended` over its moves, arcs as chords of 10° (figure 20).

G64 blends; G61 and G61.1, a change between feed and rapids, and whatever the axes rest for come to rest. The motion
keeps the feed of each move and meets every target; it keeps neither acceleration nor jerk nor, after a corner, path.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import pi
from typing import Any

import numpy as np

from rds.interpolators.motion.blended import SAME, blended
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import MARGIN
from rds.interpolators.motion.resting import Resting
from rds.interpolators.motion.samples import SampleBlock
from rds.interpolators.motion.segments import BLEND, LINE, pieces, points_at

CHORD = pi / 18.0  # rad, of an arc


def blended_path(
    blocks: Iterable[Any], limits: Limits, T: float, *, start: np.ndarray | None = None
) -> Iterator[SampleBlock]:
    """The samples of a program's motion; blocks and events as `plan` takes them. Raises InputError."""
    out = Resting(limits, T, start)
    for block in blocks:
        for first, segments in out.stretches(block):
            for low, high in pairwise(_cuts(segments)):
                part = segments[low:high]
                if part["length"].any():
                    _one(part, first + low, float(segments["length"][:low].sum()), limits, T, out)
            yield from out.ready()
    yield from out.rest()


def _cuts(segments: np.ndarray) -> list[int]:
    """Where parts begin that are blended as one, and the end of the last."""
    mode, rapid = segments["mode"], segments["rapid"]
    apart = (mode[:-1] != BLEND) | (mode[1:] != BLEND) | (rapid[:-1] != rapid[1:])
    return [0, *(np.flatnonzero(apart) + 1).tolist(), len(segments)]


def _one(part: np.ndarray, first: int, before: float, limits: Limits, T: float, out: Resting) -> None:
    """The motion over one part, from rest to rest; `before`: its programmed way from the stretch's start."""
    points: list[np.ndarray] = [part[0]["start"]]
    at: list[tuple[int, float, float]] = []  # of each move: its segment, programmed way to its start and to its end
    feeds: list[float] = []
    chords = np.where(part["plane"] == LINE, 1, np.ceil(np.abs(part["sweep"]) / CHORD - 1e-9).clip(1)).astype(int)
    owner, share = pieces(np.where(part["length"] > 0.0, chords, 0))
    length = part["length"][owner] / chords[owner]
    way = before + (np.cumsum(part["length"]) - part["length"])[owner] + share * part["length"][owner]
    for k, point, piece, to in zip(owner, points_at(part[owner], share), length, way, strict=True):
        move = point - points[-1]
        size = float(np.linalg.norm(move))
        if size < SAME:
            continue
        points.append(point)
        at.append((k, to - piece, to))
        feeds.append(_feed(part[k], move, size, piece, limits))
    if not at:
        return
    motion = blended(np.array(points), feeds, T)
    rows = motion.move[1:]
    owner, begin, end = (np.array(column)[rows] for column in zip(*at, strict=True))
    targets = np.array(points)
    a, move = targets[rows], targets[rows + 1] - targets[rows]
    along = ((motion.position[1:] - a) * move).sum(axis=1) / (move**2).sum(axis=1)
    distance = begin + np.clip(along, 0.0, 1.0) * (end - begin)
    out.move(motion.position[1:], motion.velocity[1:], motion.acceleration[1:], first + owner, distance)


def _feed(segment: np.ndarray, move: np.ndarray, size: float, length: float, limits: Limits) -> float:
    """mm/s (degrees/s) along `move`, which is `length` of the programmed way: programmed, and what the axes can do."""
    moving = np.abs(move) > 0.0
    most = float(((1.0 - MARGIN) * limits.velocity[moving] / np.abs(move[moving])).min()) * size
    return most if segment["rapid"] else min(most, float(segment["rate"]) * size / length)
