"""A run that a panel started: it can be watched, changed and stopped, and leaves its files in the session's folder."""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.experiment.experiment import Experiment
from rds.experiment.report import save_with_report
from rds.experiment.run import Run
from rds.modes import load_mode
from rds.results import Result
from rds.session.session import RUNS, Session
from rds.session.task import Task

LOOKS = 0.05  # s between looks whether it is over


class EquipmentRun:
    """One run of `table`, the words of an experiment. `start()` returns at once.

    It is work that a progress bar can follow: share, seconds_left, note, done, stop(). InputError at once for what
    will not do; an error of the run is in `error` when it is over.
    """

    def __init__(self, session: Session, table: dict[str, Any], title: str | None = None):
        self.session = session
        self.experiment = Experiment.from_table(table, session.folder)
        self.plan = self.experiment.plan()
        self.real_time = load_mode(self.plan.mode).real_time
        self.folder: Path = session.folder / RUNS / _name(self.plan.names, self.plan.mode)
        self.title = title or f"{', '.join(self.plan.names)}, {self.plan.mode}"
        self.files: dict[str, Path] = {}
        self._run: Run | None = None
        self._task: Task[Result] | None = None
        self._seen = 0

    def start(self) -> EquipmentRun:
        """Begin; InputError if the machine is in use."""
        if self.real_time:
            self.session.take_machine(self.title, self)
        try:
            self._run = self.experiment.start(out=self.folder)
            self._task = self.session.work(self.title, self._follow, self._run.stop)
        except BaseException:
            self.session.give_machine_back(self)
            raise
        return self

    def _follow(self, task: Task[Result]) -> Result:
        run = self._run
        assert run is not None
        try:
            result = run.wait(lambda taken, of: task.advance(taken, of, "running" if self.real_time else "simulating"))
            task.note = "saving"
            self.files = save_with_report(result, self.folder, self.title)
            return result
        finally:
            self.session.give_machine_back(self)

    # what a progress bar follows

    @property
    def share(self) -> float | None:
        """0 to 1."""
        return self._task.share if self._task else None

    @property
    def seconds_left(self) -> float | None:
        """s."""
        return self._task.seconds_left if self._task else None

    @property
    def note(self) -> str:
        """What it does now."""
        return self._task.note if self._task else ""

    @property
    def done(self) -> bool:
        """Whether it is over, files and all."""
        return self._task is not None and self._task.done

    def stop(self) -> None:
        """Ask for a safe end; what was recorded is kept."""
        if self._task is not None:
            self._task.stop()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for its end; false after `timeout` s."""
        return self._task is None or self._task.wait(timeout)

    @property
    def result(self) -> Result | None:
        """What it left; None while it runs, or if it failed."""
        return self._task.result if self._task else None

    @property
    def error(self) -> BaseException | None:
        """Why it failed."""
        return self._task.error if self._task else None

    # what happens meanwhile

    def traces(self) -> list[tuple[str, str]]:
        """The names and units of what `new_rows` gives beside the time."""
        if self._run is None or not self._run.columns:
            return []
        return [(name, self._run.units.get(name, "")) for name in self._shown()]

    def new_rows(self) -> np.ndarray:
        """Rows recorded since it was last asked: time in s, then one column per trace."""
        if self._run is None or not self._run.columns:
            return np.empty((0, 1))
        first, rows = self._run.read(self._seen)
        self._seen = first + len(rows)
        columns = self._run.columns
        chosen = [columns.index(name) for name in self._shown()]
        times = np.arange(first, first + len(rows)) * self.plan.T
        return np.column_stack([times, rows[:, chosen]]) if len(rows) else np.empty((0, 1 + len(chosen)))

    def _shown(self) -> Sequence[str]:
        assert self._run is not None
        wanted = [
            f"{axis}_{kind}" for axis in self.plan.names for kind in ("reference", "measured", "modelled", "voltage")
        ]
        return [name for name in wanted if name in self._run.columns]

    @property
    def live_values(self) -> dict[str, Any]:
        """The channels whose values can be changed now, by name."""
        return dict(self._run.desk.channels) if self._run is not None else {}

    def change(self, name: str, value: float) -> None:
        """Change a live value from the next sample on; InputError where that will not do, or when it is over."""
        if self._run is None:
            raise InputError("the run has not begun")
        self._run.desk.set(name, value)

    @property
    def changes(self) -> list[Any]:
        """The changes that the loop has taken, as (time in s, name, value)."""
        return list(self._run.changes) if self._run is not None else []


def _name(axes: Sequence[str], mode: str) -> str:
    return f"{time.strftime('%Y%m%d-%H%M%S')}-{'-'.join(axes)}-{mode}-{secrets.token_hex(2)}"
