"""What a program makes a machine do: segments of its path, and the events among them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np


class Event(NamedTuple):
    """What happens after the segment `after` of its block (−1: before the first), by the program's line `line`.

    Kinds and values: "dwell" s; "spindle" rev/min, + clockwise (0: it stops); "stop" 0 (M0, M60) or 1 (M1, optional);
    "tool" its number; "coolant" "flood on", "flood off", "mist on" or "mist off"; "output" as "digital 0 1" (kind,
    number, value); "override" FREE_FEED, LOCKED_FEED (M49) or TIED_FEED (threads, taps); "end" 0 (M2, M30, or the
    last line).
    """

    after: int
    kind: str
    value: float | str
    line: int


BY_PITCH = -1  # in place of the line of a word F: the pitch and the spindle's speed give the feed


class DefaultFeed(NamedTuple):
    """What a machine moves at by feed where no word F says more (option default-feed of the dialect)."""

    machine: str
    linear: float  # mm/min
    rotary: float  # degrees/min, of moves of A, B, C alone


@dataclass(frozen=True)
class PathBlock:
    """Segments (dtype SEGMENT) in machine coordinates, and the events among them, all of one file and one tool.

    `feed_lines` gives for each segment the line whose word F it obeys (0: one in another file;
    BY_PITCH: none, in a thread or a tap).
    """

    segments: np.ndarray
    events: list[Event] = field(default_factory=list)
    file: str = ""
    tool: int = 0
    feed_lines: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))

    def __len__(self) -> int:
        return len(self.segments)
