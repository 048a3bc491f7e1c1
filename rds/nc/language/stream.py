"""What comes out of the interpreter: moves gathered into blocks, other calls in order between them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from rds.nc.language.batch import Batch
from rds.nc.language.canon import BLOCK_ROWS, RATE, SPEED, Call, MotionBlock
from rds.nc.language.motion_rows import Columns, empty

if TYPE_CHECKING:
    from rds.nc.compensation.compensation import Compensation

_REST = (0.0,) * 3
_ONLY = (0.0,) * 8
FEW = 1024  # rows handed over that are worth no block of their own
FEW_OF_BATCH = 16  # the same of a batch, which compiled code writes


class Stream:
    """Takes rows and calls in program order; `items` is what can be handed on.

    `line`, `digits`, `n` and `file` say which block is being executed. While `compensation` is set, feed rates,
    speeds and calls go through it to keep their place among the moves that it holds back.
    """

    def __init__(self) -> None:
        self.items: list[MotionBlock | Call | Batch] = []
        self.in_batches = False  # whether batches are handed on whole
        self.compensation: Compensation | None = None
        self.line = self.digits = self.n = 0
        self._file = ""
        self._empty()

    def _empty(self) -> None:
        self._columns = empty()
        self._kinds, self._digits, self._ns, self._lines, self._values = self._columns

    @property
    def columns(self) -> Columns:
        """The rows gathered so far, to add to."""
        return self._columns

    def make_room(self, rows: int) -> None:
        """So many rows may be added to `columns`."""
        if len(self._kinds) + rows > BLOCK_ROWS:
            self.flush()

    @property
    def file(self) -> str:
        return self._file

    @file.setter
    def file(self, name: str) -> None:
        if name != self._file:
            self.flush()
            self._file = name

    def straight(self, kind: int, end: tuple[float, float, float, float, float, float]) -> None:
        """TRAVERSE or FEED to x, y, z, a, b, c."""
        self._values.extend(end + _REST)
        self._row(kind)

    def row(self, kind: int, values: tuple[float, ...]) -> None:
        """A row with all nine values."""
        self._values.extend(values)
        self._row(kind)

    def _row(self, kind: int) -> None:
        self._kinds.append(kind)
        self._digits.append(self.digits)
        self._ns.append(self.n)
        self._lines.append(self.line)
        if len(self._kinds) >= BLOCK_ROWS:
            self.flush()

    def rate(self, rate: float) -> None:
        """SET_FEED_RATE."""
        self._number(RATE, rate)

    def speed(self, speed: float) -> None:
        """SET_SPINDLE_SPEED."""
        self._number(SPEED, speed)

    def _number(self, kind: int, value: float) -> None:
        if self.compensation is None:
            self.row(kind, (value, *_ONLY))
        else:
            self.put(self.compensation.other((kind, self.digits, self.n, self.line, (value, *_ONLY))))

    def call(self, name: str, *args: Any) -> None:
        """Any other canonical call."""
        n = str(self.n).zfill(self.digits) if self.digits else ""
        call = Call(name, args, self.line, n, self._file)
        if self.compensation is None:
            self.flush()
            self.items.append(call)
        else:
            self.put(self.compensation.other(call))

    def comment(self, text: str) -> None:
        self.call("COMMENT", text)

    def put(self, items: Iterable[Any]) -> None:
        """Rows (tuples) and calls that compensation lets go."""
        for item in items:
            if isinstance(item, Call):
                self.flush()
                self.items.append(item)
            else:
                kind, digits, n, line, values = item
                self._values.extend(values)
                self._digits.append(digits)
                self._ns.append(n)
                self._lines.append(line)
                self._kinds.append(kind)
                if len(self._kinds) >= BLOCK_ROWS:
                    self.flush()

    def rows(self, columns: Columns) -> None:
        """Rows from somewhere else, at most BLOCK_ROWS of them, which are the stream's from now on."""
        count = len(columns.kinds)
        if count > FEW or count + len(self._kinds) > BLOCK_ROWS:
            self.flush()
        if count > FEW:
            self.items.append(MotionBlock(columns, self._file))
        else:
            self._columns.extend(columns)

    def batch(self, columns: Columns, text: bytes) -> None:
        """Moves and calls from somewhere else; `text` is what their rows quote."""
        batch = Batch(columns, text, self._file)
        if self.in_batches and len(batch) > FEW_OF_BATCH:
            self.flush()
            self.items.append(batch)
            return
        for part in batch.parts():
            if isinstance(part, Call):
                self.flush()
                self.items.append(part)
            else:
                self.rows(part.columns)

    def flush(self) -> None:
        """What has been gathered becomes a block."""
        if self._kinds:
            self.items.append(MotionBlock(self._columns, self._file))
            self._empty()
