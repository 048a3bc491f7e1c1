"""The load of the host's processor: with a machine there and nothing to do, while it is set up, while it runs.

Oacs-thesis, figure 83, shows the same of its host: below 4 % on average in the steady state, 38 % at most.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field

INTERVAL = 0.1  # s from one reading to the next
_SHORTEST = 0.02  # s that a phase's last reading may be of


@dataclass
class HostLoad:
    """Readings of the processor's load: `read()` as often as one likes, a row each `INTERVAL`.

    Rows are time (s since the first), this process (% of one processor), the whole computer (% of all; NaN where the
    system does not tell), and the phase in which they were taken.
    """

    phase: str = "idle"
    rows: list[tuple[float, float, float, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._begun = self._at = time.perf_counter()
        self._own, self._all = time.process_time(), _computer()

    def enter(self, phase: str) -> None:
        """Another phase begins; what is left of the one before gets a row."""
        self.read(_SHORTEST)
        self.phase = phase

    def rest(self, seconds: float) -> None:
        """Do nothing for so long, and read."""
        until = time.perf_counter() + seconds
        while (left := until - time.perf_counter()) > 0.0:
            time.sleep(min(left, INTERVAL))
            self.read()

    def read(self, interval: float = INTERVAL) -> None:
        """Take a row if the last one is at least `interval` (s) ago."""
        now = time.perf_counter()
        passed = now - self._at
        if passed < interval:
            return
        own, computer = time.process_time(), _computer()
        busy = float("nan")
        if computer and self._all and computer[1] > self._all[1]:
            busy = 100.0 * (computer[0] - self._all[0]) / (computer[1] - self._all[1])
        self.rows.append((now - self._begun, 100.0 * (own - self._own) / passed, busy, self.phase))
        self._at, self._own, self._all = now, own, computer

    def summary(self) -> dict[str, dict[str, float | None]]:
        """Mean and maximum of each phase, %: of this process (of one processor) and of the computer (of all)."""
        told: dict[str, dict[str, float | None]] = {}
        for phase in dict.fromkeys(row[3] for row in self.rows):
            own = [row[1] for row in self.rows if row[3] == phase]
            computer = [row[2] for row in self.rows if row[3] == phase and row[2] == row[2]]
            told[phase] = {
                "process_mean": sum(own) / len(own),
                "process_max": max(own),
                "computer_mean": sum(computer) / len(computer) if computer else None,
                "computer_max": max(computer) if computer else None,
            }
        return told


def _computer() -> tuple[int, int] | None:
    """Ticks in which the processors were busy, and all ticks; None where the system does not tell (Linux does)."""
    try:
        with open("/proc/stat", encoding="ascii") as file:
            ticks = [int(word) for word in file.readline().split()[1:9]]
    except (OSError, ValueError):
        return None
    return (sum(ticks) - ticks[3] - ticks[4], sum(ticks)) if os.name == "posix" else None
