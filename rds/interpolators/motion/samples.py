"""Samples of planned motion, in blocks."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np


@dataclass(frozen=True)
class SampleBlock:
    """Samples of the axes X Y Z A B C (columns), T apart. Sample 0 is at rest where the program starts.

    first: number of the first row's sample. position (m, 6): mm, degrees; velocity, acceleration: per s and s².
    line: the program line of each sample; segment: which of the program's segments; distance: how far along the
    programmed path, mm (degrees where only rotary axes move). events: (sample, event), the sample at which the motion
    has come to rest for it, or passes it. path: the segments that the samples belong to with their neighbours, from
    number path_first on, and path_at, how far along the programmed path these begin.
    """

    first: int
    T: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    line: np.ndarray
    segment: np.ndarray
    distance: np.ndarray
    path: np.ndarray
    path_first: int
    path_at: float
    events: list[tuple[int, Any]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.position)


class Rows:
    """Samples gathered to blocks of a good size."""

    def __init__(self, T: float):
        self.T, self.total = T, 0
        self.parts: list[tuple[np.ndarray, ...]] = []
        self.rows = 0
        self.events: list[tuple[int, Any]] = []

    def __len__(self) -> int:
        return self.rows

    def add(self, *columns: np.ndarray) -> None:
        self.parts.append(columns)
        self.rows += len(columns[0])
        self.total += len(columns[0])

    def segments(self) -> tuple[int, int]:
        """First and last segment of the rows."""
        return int(self.parts[0][4][0]), int(self.parts[-1][4][-1])

    def block(self, path: np.ndarray, path_first: int, path_at: float) -> SampleBlock:
        columns = [np.concatenate(column) for column in zip(*self.parts, strict=True)]
        first = self.total - self.rows
        now = [event for event in self.events if event[0] < self.total]
        self.events = [event for event in self.events if event[0] >= self.total]
        self.parts, self.rows = [], 0
        position, velocity, acceleration, line, segment, distance = columns
        return SampleBlock(
            first, self.T, position, velocity, acceleration, line, segment, distance, path, path_first, path_at, now
        )
