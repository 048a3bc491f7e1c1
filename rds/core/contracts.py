"""What the parts of the loop promise each other. The loop knows these verbs and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

Watch = Callable[[str, float], object]  # hears which axis is being homed, and its position in axis units
Limits = tuple[float, float]  # the lowest and highest position, axis units; infinite where there is none


class Motion(Protocol):
    """A model in motion, one axis: it holds a state and moves on by one sample at a time.

    That of a model which `has_velocity` has an attribute `velocity` as well: the velocity now, mm/s. Of what a model
    has `told`, too.
    """

    def read(self) -> float:
        """The output now: position in mm (speed in rev/min for a spindle), before the encoder."""

    def write(self, voltage: float) -> None:
        """Move on by one sample period with a constant `voltage` in V."""

    @property
    def dead_time(self) -> float:
        """The model's own delay, s: `write` keeps it, `move` leaves it to its caller."""

    def move(self, voltage: float, time: float) -> None:
        """Move on by `time` s, at most a sample period, with a constant `voltage` in V that acts at once."""


@dataclass
class Counters:
    """What went over the bus besides the expected answers. A dialect may count more."""

    ticks: int = 0  # sent
    missing: int = 0  # answers that did not come in their period
    silent: int = 0  # periods in which a module gave no answer at all, not even a late one
    late: int = 0  # answers to an earlier tick
    foreign: int = 0  # frames that no module of ours sent


def unwatched(axis: str, position: float) -> None:
    """Nobody watches the homing."""


class Drivers(Protocol):
    """The real input and output of all axes: what emulation times, implementation uses, and a hand jogs.

    Values are in the order of the axes. Positions (axis units) count from where the axis stood at start(), a spindle's
    speed from zero. Every verb but stop() and close() raises MachineError when a module or the bus has failed.
    """

    @property
    def counters(self) -> Counters:
        """What was counted since start()."""

    @property
    def standing(self) -> list[float]:
        """Where the axes stood at start() by their modules' own counters, axis units: the zero of exchange()."""

    @property
    def limits(self) -> Sequence[Limits]:
        """The limits that each module has itself, axis units from its own zero, known since start()."""

    @property
    def force(self) -> float | None:
        """What the load cell of the cutting head measured last, N; None where none has said anything."""

    def start(self, watch: Watch = unwatched) -> None:
        """Set the modules up, and return when every one answers and all axes stand.

        `watch` is called while an axis is homed; what it raises ends the homing, and comes out of here.
        """

    def exchange(self) -> Sequence[float]:
        """Send the waiting commands as this cycle's tick; return every axis's measured position at the tick."""

    def write(self, commands: Sequence[float], /) -> Sequence[float]:
        """Take the next commands (V, unless the modules were set up for others); the next tick sends them.

        Returns those that act from this tick on.
        """

    def confirm(self) -> None:
        """After the last sample: MachineError if a module that was silent at the end is gone, not late."""

    def stop(self) -> None:
        """No voltage on any axis, now; never raises: where it can't be sent, the modules' watchdogs do it."""

    def close(self) -> None:
        """Stop, then let go of the bus."""
