"""Samples gathered from motion that comes to rest again and again, with what happens while it rests."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import ceil
from typing import Any

import numpy as np

from rds.interpolators.motion.checking import check_segments
from rds.interpolators.motion.limits import Limits
from rds.interpolators.motion.planner import ENOUGH
from rds.interpolators.motion.samples import Rows, SampleBlock
from rds.interpolators.motion.segments import SEGMENT

_MOST_RESTING = 16384  # samples at once


class Resting:
    """Takes moves (`move`) and gives blocks of samples (`ready`, and `rest` at the end); events are met at rest.

    Sample 0 is at rest where the program starts. `start`: where the axes are if events come before motion.
    """

    def __init__(self, limits: Limits, T: float, start: np.ndarray | None = None):
        self._limits, self._T = limits, T
        self._point = None if start is None else np.array(start, dtype=float)
        self._end: np.ndarray | None = None
        self._out = Rows(T)
        self._done: list[SampleBlock] = []
        self._path, self._first, self._at = np.empty(0, SEGMENT), 0, 0.0  # of the block, and of its first segment
        self._before = 0.0  # programmed way before the move
        self._line = self._number = 0

    def segments(self, block: Any) -> Iterator[tuple[int, np.ndarray]]:
        """The segments of a block with a way to go, with their numbers in the program; between them, its events."""
        for number, segments in self.stretches(block, 1):
            yield number, segments[0]

    def stretches(self, block: Any, most: int | None = None) -> Iterator[tuple[int, np.ndarray]]:
        """Runs of segments without an event between them, at most `most` long, and the number of their first."""
        path, due = getattr(block, "segments", block), dict[int, list[Any]]()  # what happens after which segment
        for event in getattr(block, "events", ()):
            due.setdefault(event.after, []).append(event)
        if len(path):
            check_segments(path, self._limits.present, self._end)
            self._end = path["end"][-1].copy()
        self._hand_on()
        self._first += len(self._path)
        self._at += float(self._path["length"].sum())
        self._before, self._path = self._at, path
        if len(path):
            self._number = self._first
        if self._point is None and len(path):
            self._point = path["start"][0].copy()
        if self._out.total == 0 and (len(path) or due):
            self._line = int(path["line"][0]) if len(path) else 0
            self._stay(1)
        self._happen(due.get(-1, ()))
        k = 0
        while k < len(path):
            upto = k + 1
            limit = len(path) if most is None else min(k + most, len(path))
            while upto < limit and upto - 1 not in due:
                upto += 1
            if path["length"][k:upto].any():
                yield self._first + k, path[k:upto]
            self._before += float(path["length"][k:upto].sum())
            self._line, self._number = int(path["line"][upto - 1]), self._first + upto - 1
            self._happen(due.get(upto - 1, ()))
            k = upto

    def move(
        self,
        position: np.ndarray,
        velocity: np.ndarray,
        acceleration: np.ndarray,
        number: np.ndarray,
        way: np.ndarray,
    ) -> None:
        """The samples of a stretch after its start, the last at rest on its end; `way` along it, programmed."""
        line = self._path["line"][number - self._first]
        last = self._path[number[-1] - self._first]
        position[-1], velocity[-1], acceleration[-1] = last["end"], 0.0, 0.0
        self._out.add(position, velocity, acceleration, line.astype(np.int32), number, self._before + way)
        self._point = last["end"].copy()
        if len(self._out) >= ENOUGH:
            self._hand_on()

    def ready(self) -> Iterator[SampleBlock]:
        """Blocks that are full."""
        yield from self._done
        self._done.clear()

    def rest(self) -> Iterator[SampleBlock]:
        """What is left."""
        self._hand_on()
        yield from self.ready()

    def _happen(self, events: Iterable[Any]) -> None:
        for event in events:
            self._out.events.append((self._out.total - 1, event))
            rows = ceil(event.value / self._T - 1e-9) if event.kind == "dwell" else 0
            while rows > 0:
                part = min(rows, _MOST_RESTING)
                self._stay(part)
                rows -= part
                if len(self._out) >= ENOUGH:
                    self._hand_on()

    def _stay(self, rows: int) -> None:
        point = np.zeros(6) if self._point is None else self._point
        still = np.zeros((rows, 6))
        line, number = np.full(rows, self._line, np.int32), np.full(rows, self._number)
        self._out.add(np.tile(point, (rows, 1)), still, still, line, number, np.full(rows, self._before))

    def _hand_on(self) -> None:
        if len(self._out):
            low, high = (int(k) - self._first for k in self._out.segments())
            low, high = max(low - 2, 0), min(high + 3, len(self._path))
            at = self._at + float(self._path["length"][:low].sum())
            self._done.append(self._out.block(self._path[low:high].copy(), self._first + low, at))
