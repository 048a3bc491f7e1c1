"""Moves, feed rates and speeds as they are gathered, in columns, and as the rows of a numpy array.

`rds nc canon` prints the columns, without numpy, whose import takes as long as ten thousand lines of a program.
"""

from __future__ import annotations

from array import array
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np

WIDTH = 9  # values of a row


class Columns(NamedTuple):
    """One entry each for a row, and WIDTH of `values`; canon.py says what they mean."""

    kinds: array[int]
    digits: array[int]
    ns: array[int]
    lines: array[int]
    values: array[float]

    def part(self, low: int, high: int) -> Columns:
        """A copy of the rows from `low` on, up to `high`."""
        kinds, digits, ns, lines, values = self
        own = values[WIDTH * low : WIDTH * high]
        return Columns(kinds[low:high], digits[low:high], ns[low:high], lines[low:high], own)

    def extend(self, other: Columns) -> None:
        """The rows of `other` behind these."""
        self.kinds.extend(other.kinds)
        self.digits.extend(other.digits)
        self.ns.extend(other.ns)
        self.lines.extend(other.lines)
        self.values.extend(other.values)

    def value_rows(self) -> list[list[float]]:
        """The values, row by row."""
        flat = self.values.tolist()
        return [flat[at : at + WIDTH] for at in range(0, len(flat), WIDTH)]


def empty(rows: int = 0) -> Columns:
    """Columns of so many rows of zeros."""
    small, whole = bytes(rows), bytes(4 * rows)
    values = array("d", bytes(8 * WIDTH * rows))
    return Columns(array("b", small), array("b", small), array("i", whole), array("i", whole), values)


def dtype() -> np.dtype[np.void]:
    """The dtype MOTION of the rows."""
    import numpy as np

    names = [("kind", "i1"), ("digits", "i1"), ("n", "i4"), ("line", "i4"), ("values", "f8", (WIDTH,))]
    return np.dtype(names, align=True)


def rows_of(columns: Columns) -> np.ndarray:
    """The columns as rows of dtype MOTION."""
    import numpy as np

    rows = np.zeros(len(columns.kinds), dtype())
    if len(rows):
        rows["kind"] = np.frombuffer(columns.kinds, np.int8)
        rows["digits"] = np.frombuffer(columns.digits, np.int8)
        rows["n"] = np.frombuffer(columns.ns, np.int32)
        rows["line"] = np.frombuffer(columns.lines, np.int32)
        rows["values"] = np.frombuffer(columns.values).reshape(-1, WIDTH)
    return rows


def columns_of(rows: np.ndarray) -> Columns:
    """The rows, of dtype MOTION, as columns."""
    found = empty()
    found.kinds.frombytes(rows["kind"].tobytes())
    found.digits.frombytes(rows["digits"].tobytes())
    found.ns.frombytes(rows["n"].tobytes())
    found.lines.frombytes(rows["line"].tobytes())
    found.values.frombytes(rows["values"].tobytes())
    return found
