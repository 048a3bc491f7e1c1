"""What the parts of the loop promise each other. The loop knows these verbs and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol


class Motion(Protocol):
    """A model in motion, one axis: it holds a state and moves on by one sample at a time."""

    def read(self) -> float:
        """The output now: position in mm (speed in rev/min for a spindle), before the encoder."""

    def write(self, voltage: float) -> None:
        """Move on by one sample period with a constant `voltage` in V."""


class Drivers(Protocol):
    """The real input/output of all axes: what emulation times and implementation uses."""

    def exchange(self) -> Sequence[float]:
        """Send the waiting voltages as this cycle's tick; return every axis's measured position at the tick."""

    def write(self, voltages: Sequence[float]) -> Sequence[float]:
        """Take the next voltages (sent by the next tick); return those that act from this tick on."""

    def stop(self) -> None:
        """Zero volts on all axes, now."""

    def close(self) -> None:
        """Zero volts, then let go of the bus."""


class Clock(Protocol):
    """When each sample is due."""

    def now(self) -> int:
        """Nanoseconds; always 0 where time is virtual."""

    def taken(self) -> int:
        """Nanoseconds so far in which this thread was ready to run and the system ran something else."""

    def wait(self, k: int) -> int:
        """Wait until sample `k` is due; return the sample to take now, later than `k` if periods were discarded."""

    def lateness(self, k: int, at: int) -> int:
        """Nanoseconds from the due time of sample `k` to the instant `at`."""

    def finish(self, k: int, at: int) -> bool:
        """Sample `k` was complete at the instant `at`; true if the late policy ends the run here."""
