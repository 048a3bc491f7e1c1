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

    def confirm(self) -> None:
        """After the last sample: MachineError if a module that was silent at the end is gone, not late."""

    def stop(self) -> None:
        """Zero volts on all axes, now."""

    def close(self) -> None:
        """Zero volts, then let go of the bus."""
