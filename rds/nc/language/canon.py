"""Canonical calls: what an interpreted part program tells the machine to do, one call after the other.

Names, arguments and their order are those of LinuxCNC's canonical functions (canon.hh; its `rs274 -g` prints them):
lengths in the program's units (USE_LENGTH_UNITS says which), rotary axes in degrees, positions absolute in program
coordinates (before offsets, which have calls of their own).

Moves, feed rates and spindle speeds come in blocks, which give them as rows of a numpy array; the rare other calls
one by one, in order between them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rds.nc.language.motion_rows import Columns, columns_of, dtype, rows_of

if TYPE_CHECKING:
    import numpy as np

    MOTION: np.dtype[np.void]

TRAVERSE, FEED, ARC, RATE, SPEED = 0, 1, 2, 3, 4
BLOCK_ROWS = 65536  # at most, in a MotionBlock


# values by kind: TRAVERSE and FEED: x, y, z, a, b, c of the end.
# ARC: first end, second end, first centre, second centre (absolute, along the plane's axes: XY; ZX in G18; YZ in G19),
#   turns (+ counter-clockwise, a whole number), end along the third axis, a, b, c.
# RATE: the feed rate (units/min; in inverse time 1/min, per revolution units/rev).
# SPEED: the spindle's speed (rev/min; under G96 units of its own), SET_SPINDLE_SPEED of spindle 0.
# n, digits: the line number of the word N and the number of digits that it is written with (0: the line has none).
# MOTION, the dtype of the rows, is made when it is first asked for: it takes numpy.


def __getattr__(name: str) -> Any:
    if name != "MOTION":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return globals().setdefault(name, dtype())


class MotionBlock:
    """Moves, feed rates and speeds in program order: at most BLOCK_ROWS rows of dtype MOTION, all from one file."""

    __slots__ = ("_columns", "_rows", "file")

    def __init__(self, moves: np.ndarray | Columns, file: str = ""):
        self._columns: Columns | None = moves if isinstance(moves, Columns) else None
        self._rows: np.ndarray | None = None if isinstance(moves, Columns) else moves
        self.file = file

    @property
    def columns(self) -> Columns:
        """The moves as they were gathered."""
        if self._columns is None:
            assert self._rows is not None
            self._columns = columns_of(self._rows)
        return self._columns

    @property
    def rows(self) -> np.ndarray:
        """The moves as an array of dtype MOTION."""
        if self._rows is None:
            assert self._columns is not None
            self._rows, self._columns = rows_of(self._columns), None
        return self._rows

    def __len__(self) -> int:
        return len(self._columns.kinds if self._columns is not None else self.rows)


class Call:
    """Any other canonical call: name, arguments (int, float or str, in canon's order) and the program line it is of.

    `n`: digits of the line's word N, as written. Calls are equal whatever their file.
    """

    __slots__ = ("args", "file", "line", "n", "name")

    def __init__(self, name: str, args: tuple[Any, ...] = (), line: int = 0, n: str = "", file: str = ""):
        self.name = name
        self.args = args
        self.line = line
        self.n = n
        self.file = file

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Call) and self._compared() == other._compared()

    def __hash__(self) -> int:
        return hash(self._compared())

    def __repr__(self) -> str:
        return f"Call{(*self._compared(), self.file)}"

    def _compared(self) -> tuple[str, tuple[Any, ...], int, str]:
        return self.name, self.args, self.line, self.n
