"""Canonical calls: what an interpreted part program tells the machine to do, one call after the other.

Names, arguments and their order are those of LinuxCNC's canonical functions (canon.hh; its `rs274 -g` prints them):
lengths in the program's units (USE_LENGTH_UNITS says which), rotary axes in degrees, positions absolute in program
coordinates (before offsets, which have calls of their own).

Moves, feed rates and spindle speeds come in blocks, as rows of a numpy array; the rare other calls one by one, in order
between them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

TRAVERSE, FEED, ARC, RATE, SPEED = 0, 1, 2, 3, 4
BLOCK_ROWS = 65536  # at most, in a MotionBlock

# values by kind: TRAVERSE and FEED: x, y, z, a, b, c of the end.
# ARC: first end, second end, first centre, second centre (absolute, along the plane's axes: XY; ZX in G18; YZ in G19),
#   turns (+ counter-clockwise, a whole number), end along the third axis, a, b, c.
# RATE: the feed rate (units/min; in inverse time 1/min, per revolution units/rev).
# SPEED: the spindle's speed (rev/min; under G96 units of its own), SET_SPINDLE_SPEED of spindle 0.
# n, digits: the line number of the word N and the number of digits that it is written with (0: the line has none).
MOTION = np.dtype(
    [("kind", "i1"), ("digits", "i1"), ("n", "i4"), ("line", "i4"), ("values", "f8", (9,))],
    align=True,
)


@dataclass(frozen=True, slots=True)
class MotionBlock:
    """Moves, feed rates and speeds in program order: at most BLOCK_ROWS rows of dtype MOTION, all from one file."""

    rows: np.ndarray
    file: str = ""

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True, slots=True)
class Call:
    """Any other canonical call: name, arguments (int, float or str, in canon's order) and the program line it is of."""

    name: str
    args: tuple[Any, ...] = ()
    line: int = 0
    n: str = ""  # digits of the line's word N, as written
    file: str = field(default="", compare=False)
