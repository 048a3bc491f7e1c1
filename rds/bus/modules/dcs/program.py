"""What a unit carries out by its own clock: the cyclic buffer of method C, or the segments of method B.

The host refills while it runs, so that nothing interrupts the motion at a buffer's end (dcs-thesis, 7.2). Bytes are
numbered modulo 65536: a piece that comes twice, because its answer was lost, is taken once. A unit whose buffer runs
empty stands, says so, and its clock waits for nobody: the others would leave it behind.
"""

from __future__ import annotations

from collections import deque
from math import inf

from rds.bus.modules import segments
from rds.bus.modules.dcs.commands import BUFFER, steps_of

_WRAP = 1 << 16
_FARTHEST = 1 << 31  # BLU that a position has at most; equations that lead beyond it, or to no number, end the steps
_SLEW = 0.5e-3  # s by which one message corrects a clock at most: the host's own lateness must not jerk the axes


class Program:
    """Steps that wait, each of `step_time` s, and where the next one is."""

    def __init__(self, step_time: float):
        self._step_time = step_time
        self.index = 0  # of the next step
        self.runs = False
        self.ran_empty = False
        self.due = inf
        self._received = 0  # bytes
        self._bytes: deque[int] = deque()
        self._segments: deque[segments.NodeSegment] = deque()
        self._equations: segments.Equations | None = None
        self._at = 0  # BLU that were sent so far

    @property
    def filled(self) -> bool:
        """Whether steps wait."""
        return bool(self._bytes or self._segments or self._equations)

    def begin(self, counts: int) -> None:
        """The first data come while the unit stands at `counts` BLU."""
        self._at = counts

    def take(self, as_segments: bool, index: int, data: bytes) -> int:
        """Data whose first byte has this number; the number of the byte that is wanted next.

        What is there already is taken once; what does not fit, or leaves a hole, is not taken at all.
        """
        if index != self._received % _WRAP:
            return self._received % _WRAP
        waiting = len(self._bytes) + segments.SIZE * len(self._segments)
        if waiting + len(data) > BUFFER:
            return self._received % _WRAP
        if as_segments:
            whole = len(data) // segments.SIZE * segments.SIZE
            self._segments.extend(segments.unpack(data[i : i + segments.SIZE]) for i in range(0, whole, segments.SIZE))
            self._received += whole
        else:
            self._bytes.extend(data)
            self._received += len(data)
        return self._received % _WRAP

    def start(self, at: float) -> None:
        """Begin with the first step at the instant `at`."""
        if not self.runs and self.filled:
            self.runs, self.due, self.ran_empty = True, at, False

    def step(self) -> int | None:
        """The BLU of the step that is due; None if there is none. What was not sent of a whole BLU is carried."""
        if not self.filled:
            self._end()
            return None
        self.due += self._step_time
        self.index += 1
        if self._bytes:
            count = steps_of(self._bytes.popleft())
            self._at += count
            return count
        if self._equations is None:
            self._equations = segments.Equations(self._segments.popleft())
        place = self._equations.next()
        if not abs(place) < _FARTHEST:
            self._end()
            return None
        target = round(place)
        if self._equations.left <= 0:
            self._equations = None
        count, self._at = target - self._at, target
        return count

    def _end(self) -> None:
        self._bytes.clear()
        self._segments.clear()
        self._equations = None
        self.runs, self.due, self.ran_empty = False, inf, True

    def correct(self, low: int, at: float) -> None:
        """The host's clock says that the step whose number ends in these eight bits begins at the instant `at`."""
        if not self.runs:
            return
        ahead = (low - self.index + 128) % 256 - 128
        late = at - ahead * self._step_time - self.due
        if abs(late) < 0.5 * self._step_time:
            self.due = max(self.due + min(max(late, -_SLEW), _SLEW), at)
