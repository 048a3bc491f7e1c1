"""Limit switches: normally closed, and debounced by the time that a level has to last (oacs-thesis 6.10).

A switch that opens, by contact or because a wire breaks, stops the axis: a broken wire is noticed at once, not at the
next collision. A level counts once it has lasted the debounce time, 100 ms, as the thesis's glitch filter has it;
what is shorter is a glitch. The thesis's other boards stop at the first edge and ignore more edges for 100 ms, which
lets a single glitch stop the machine; the filter is chosen for all.
"""

from __future__ import annotations


class Debouncer:
    """A level that has lasted `time` s. `level` is accepted; `mark` is whatever was noted when it came."""

    def __init__(self, time: float):
        self.time = time
        self.level = True
        self.mark = 0
        self._raw = True
        self._since = 0.0
        self._mark = 0

    @property
    def due(self) -> float | None:
        """When a level that differs from the accepted one will have lasted long enough; None if there is none."""
        return None if self._raw == self.level else self._since + self.time

    def feed(self, raw: bool, at: float, mark: int = 0) -> bool:
        """The raw level is `raw` from the instant `at` (s) on; return whether another level has been accepted."""
        changed = self.settle(at)
        if raw != self._raw:
            self._raw, self._since, self._mark = raw, at, mark
        return changed

    def settle(self, now: float) -> bool:
        """Accept a level that has lasted long enough by `now`; return whether there was one."""
        due = self.due
        if due is None or now < due - 1e-9:
            return False
        self.level, self.mark = self._raw, self._mark
        return True


class LimitSwitch:
    """The switch at one end: opens where the axis is beyond `position` on its `side` (-1 lower, +1 upper)."""

    def __init__(self, position: float, side: int, debounce: float):
        self.position = position
        self.side = side
        self.wire: bool | None = None  # True, False: the wire is bridged, broken; None: the switch decides
        self._debouncer = Debouncer(debounce)

    @property
    def open(self) -> bool:
        """Whether it counts as open."""
        return not self._debouncer.level

    @property
    def mark(self) -> int:
        """The count at which the accepted level began."""
        return self._debouncer.mark

    @property
    def due(self) -> float | None:
        """When a new level will be accepted if it lasts, s."""
        return self._debouncer.due

    def look(self, position: float, at: float, count: int) -> bool:
        """The axis is at `position` at the instant `at`, where `count` is recorded; whether the switch now changed."""
        closed = (position - self.position) * self.side < 0 if self.wire is None else self.wire
        return self._debouncer.feed(closed, at, count)
