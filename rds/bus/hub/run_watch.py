"""The built-in bus during a run: the run's faults are injected, and what the bus did is told afterwards."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

from rds.bus.hub.faults import Faults
from rds.bus.medium.fault_kinds import Fault
from rds.core.errors import RdsError


class RunWatch:
    """A line to the hub of `channel`, open for a run; the run's `faults` end with it.

    Raises MachineError if there is no bus.
    """

    def __init__(self, channel: str, faults: Sequence[Fault] = ()):
        self._line = Faults(channel)
        self._faults = tuple(faults)

    def start(self) -> None:
        """The faults' times count from now, and so do the statistics. InputError for a fault that can't be."""
        self._line.statistics(reset=True)
        if self._faults:
            self._line.check_names(self._faults)
            self._line.play(self._faults)

    def summary(self) -> dict[str, Any]:
        """What the bus did since then (see Faults.statistics) and its nodes; empty if it has ended."""
        with contextlib.suppress(RdsError):
            return self._line.statistics() | {"nodes": self._line.nodes()}
        return {}

    def __enter__(self) -> RunWatch:
        return self

    def __exit__(self, *_: object) -> None:
        self._line.close()
