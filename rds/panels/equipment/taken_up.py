"""A run that was begun elsewhere, taken up by a page: in another tab, in a terminal, or before this page was reloaded.

It is followed by its record and its live values, and ends where it always would have; Stop ends it before.
"""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.modes.loop.changes import timed
from rds.modes.loop.live_values_of_run import live_values_of
from rds.modes.loop.program import HOLD, OVERRIDE
from rds.modes.process.record import RecordTail
from rds.panels.equipment.run import followed, shown
from rds.panels.session.kept_runs import KeptRun, State, state_of
from rds.results import Result

_LOOK = 0.3  # s between two looks at whether it is over


def is_driven_by(kept: KeptRun) -> str:
    """What drives a run that goes on, as the equipment panels are called: "model" (a signal) or "control"."""
    from rds.modes import mode_names

    by_signals = set(mode_names("signal")) - set(mode_names("controller"))
    return "model" if any(f"-{mode}-" in kept.name for mode in by_signals) else "control"


class TakenUpRun:
    """What a strip and a progress bar follow of such a run: as `EquipmentRun`, which it did not start."""

    real_time = True
    prepared = None  # its path is known to whoever began it
    stopped_early = False
    written, unwritten = True, None  # whoever began it makes its pictures and report

    def __init__(self, kept: KeptRun):
        self.kept = kept
        self.folder: Path = kept.folder
        self.result: Result | None = None
        self.error: BaseException | None = None
        self._tail: RecordTail | None = None
        self._taken = 0
        self._looked = 0.0
        self._state = kept.state
        self._channels: dict[str, Any] = {}
        self._changes: list[Any] = []
        self._asked_to_stop = False

    # what a progress bar follows

    @property
    def share(self) -> float | None:
        """0 to 1 of the samples that were planned; None before the first."""
        of = self._about.get("samples")
        return min(self._taken / of, 1.0) if self._taken and of else None

    @property
    def seconds_left(self) -> float | None:
        """s; None before the first sample, and while its results are saved."""
        of, T = self._about.get("samples"), self._about.get("sample_period")
        return max(of - self._taken, 0) * T if self._taken and of and T and self._state is State.GOES_ON else None

    @property
    def note(self) -> str:
        """What it does now."""
        if self._state is State.SAVED_NOW:
            return "its page saves it"
        return "stopping" if self._asked_to_stop else "running, begun elsewhere"

    @property
    def done(self) -> bool:
        """Whether it is over and its results, or else its record, are there."""
        if self.result is not None or self.error is not None:
            return True
        if time.monotonic() - self._looked < _LOOK:
            return False
        self._looked = time.monotonic()
        self._state = state_of(self.folder) or State.CUT_SHORT
        if self._state in (State.WHOLE, State.CUT_SHORT):
            try:
                self.result = self.kept.open()
            except InputError as error:
                self.error = error
        return self.result is not None or self.error is not None

    def stop(self) -> None:
        """Ask for a safe end; what was recorded is kept."""
        self._asked_to_stop = True
        self.kept.stop()

    # what happens meanwhile

    def traces(self) -> list[tuple[str, str]]:
        """The names and units of what `new_rows` gives beside the time; none before the record has begun."""
        units, columns = self._about.get("units", {}), self._about.get("columns", [])
        found = [(name, units.get(name, "")) for name in shown(columns)]
        return found + [(f"{axis}_error", units.get(f"{axis}_measured", "")) for axis in followed(columns)]

    def new_rows(self) -> np.ndarray:
        """Rows recorded since it was last asked: time in s, then one column per trace."""
        if self._tail is None:
            return np.empty((0, 1))
        columns, rows = self._about["columns"], self._tail.new()
        if not len(rows):
            return np.empty((0, 1 + len(self.traces())))
        of = dict(zip(columns, rows.T, strict=True))
        self._taken = int(of["sample"][-1]) + 1
        errors = [of[f"{axis}_reference"] - of[f"{axis}_measured"] for axis in followed(columns)]
        return np.column_stack(
            [of["sample"] * self._about["sample_period"], *(of[name] for name in shown(columns)), *errors]
        )

    @property
    def live_values(self) -> dict[str, Any]:
        """What can be changed now, by name; none when it is over."""
        if not self._channels and self._state is State.GOES_ON:
            with contextlib.suppress(InputError), live_values_of(self.folder) as live_values:
                now = live_values.values()
                wanted = {
                    name: each for name, each in live_values.channels.items() if "." in name or name in (HOLD, OVERRIDE)
                }
                self._channels = {name: replace(each, value=now[name]) for name, each in wanted.items()}
        return self._channels

    def change(self, name: str, value: float) -> None:
        """Change a live value from the next sample on; InputError where that will not do, or when it is over."""
        with live_values_of(self.folder) as live_values:
            live_values.set(name, value)

    @property
    def changes(self) -> list[Any]:
        """The changes that the loop has taken: time in s, name, old value, new value each."""
        if self.result is not None:
            return list(self.result.meta.get("changes") or [])
        with contextlib.suppress(InputError), live_values_of(self.folder) as live_values:
            self._changes = timed(live_values.notes()[1], float(self._about.get("sample_period", 0.0)))
        return self._changes

    @property
    def _about(self) -> dict[str, Any]:
        if self._tail is None:
            try:
                self._tail = RecordTail(self.folder)
            except InputError:  # its first sample is yet to come
                return {}
        return self._tail.about
