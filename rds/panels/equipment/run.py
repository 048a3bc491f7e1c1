"""A run that a panel started: it can be watched, changed and stopped, and leaves its files in the session's folder."""

from __future__ import annotations

import contextlib
import secrets
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import ContractError, InputError, RdsError
from rds.modes import DEFAULT, load_mode
from rds.modes.experiment.experiment import Experiment, FailedRun
from rds.modes.experiment.experiment_file import PATHS
from rds.modes.experiment.report import save_run
from rds.modes.experiment.run import Run
from rds.modes.loop.plan import Plan
from rds.modes.loop.program import HOLD, OVERRIDE
from rds.panels.session.background_pictures import made_beside
from rds.panels.session.run_table import keep_choices
from rds.panels.session.saving import saving
from rds.panels.session.session import RUNS, Session
from rds.panels.session.task import Stopped, Task
from rds.results import Result, open_result

if TYPE_CHECKING:
    from rds.nc.run.prepare import Prepared

_LOOK = 0.1  # s between two looks at whether a waiting run was stopped
STRIP_RATE = 100.0  # rows a second of a path whose contour error is worked out for the strip
_KINDS = ("reference", "measured", "modelled", "voltage", "target")


class EquipmentRun:
    """One run of `table`, the words of an experiment. `start()` returns at once, whatever has to be loaded first.

    It is work that a progress bar can follow: share, seconds_left, note, done, stop(). What goes wrong is in `error`
    when it is over. Its tables are saved by then; pictures and reports follow, until it is `written`.
    `prepare(pulse)` is called first, beside the page (a check of the student's files); `pulse` is of `Builds.check`.
    """

    def __init__(
        self,
        session: Session,
        table: dict[str, Any],
        title: str | None = None,
        prepare: Callable[[Callable[[], None]], object] | None = None,
    ):
        mode = str(table.get("mode", DEFAULT))
        self.session, self.table = session, table
        self.real_time = load_mode(mode).real_time
        names = [str(table["axis"])] if "axis" in table else [str(name) for name in table.get("axes", [])]
        self.folder: Path = session.folder / RUNS / _name(names, mode)
        self.title = title or f"{', '.join(names)}, {mode}"
        self.files: dict[str, Path] = {}
        self.plan: Plan | None = None
        self.prepared: Prepared | None = None  # the path, where the axes follow one together
        self.result: Result | None = None  # as soon as the loop is over; of one that failed, what there is up to then
        self._prepare = prepare
        self._run: Run | None = None
        self._task: Task[Result] | None = None
        self._writing: Task[None] | None = None
        self._seen = 0

    def start(self) -> EquipmentRun:
        """Begin; InputError if the machine is in use."""
        if self.real_time:
            self._task = self.session.work_on_machine(self, self.title, self._work, self._stop_loop)
        else:
            self._task = self.session.work(self.title, self._work, self._stop_loop)
        return self

    def _work(self, task: Task[Result]) -> Result:
        with contextlib.ExitStack() as held:
            try:
                self._await_turn(task, held)
                if self._prepare is not None:
                    self._prepare(lambda: self._tell(task, "checking your files"))
                self._tell(task, "loading")
                experiment = Experiment.from_table(self.table, self.session.folder)
                self.plan = experiment.plan()
                if (program := self.plan.program) is not None:
                    self.prepared = PATHS.module("path").as_prepared(program, Path(program.name), self.plan.T)
                self._tell(task, "starting the loop" if self.real_time else "simulating")
                # before the first sample the loop is still being started, and its note stays; so does that of a stop
                return self._follow(
                    *(task, held, lambda: experiment.start(out=self.folder)),
                    lambda taken, of, note: task.advance(taken, of, note if taken else ""),
                )
            finally:
                self.session.give_machine_back(self)
                if self.result is not None and self.plan is not None:
                    keep_choices(self.folder, self.table)
                    judged = self.plan.program if "program" in self.result.meta else None  # one that failed may not be
                    self._write_files(save_run, self.result, judged, self.folder, self.title, held=held)

    def _follow(
        self,
        task: Task[Result],
        held: contextlib.ExitStack,
        start: Callable[[], Run],
        advance: Callable[[int, int, str], None],
    ) -> Result:
        """Start the run and wait for its result; `advance(taken, of, note)` hears of each look at it."""
        held.enter_context(saving(self.folder))
        self._run = run = start()
        if task.stopping:
            run.stop()
        running = "running" if self.real_time else "simulating"
        try:
            self.result = result = run.wait(lambda taken, of: advance(taken, of, "" if task.stopping else running))
            return result
        except ContractError as error:  # what there is up to the fault is a result
            self.result = error.result if isinstance(error, FailedRun) else _recorded(self.folder)
            raise
        except RdsError as error:
            if task.stopping and type(error) is RdsError:  # what a loop says that was stopped before its first sample
                raise Stopped from error
            raise

    def _await_turn(self, task: Task[Result], held: contextlib.ExitStack) -> None:
        """Wait while too many earlier runs are not written yet; `held` counts this one until it is."""
        while not self.session.unwritten.acquire(timeout=_LOOK):
            self._tell(task, "waiting until the reports of earlier runs are written")
        held.callback(self.session.unwritten.release)

    def _write_files(self, save: Callable[..., dict[str, Path]], *of: Any, held: contextlib.ExitStack) -> None:
        """Pictures and reports, from now on and after those of earlier runs; `held` is held until they are there."""
        until = held.pop_all()

        def work(_: Task[None]) -> None:
            with until, self.session.writing:
                self.files = made_beside(save, *of)

        self._writing = self.session.work(f"pictures and report of {self.folder.name}", work)

    def _tell(self, task: Task[Result], note: str) -> None:
        if task.stopping:
            raise Stopped
        task.note = note

    def _stop_loop(self) -> None:
        if self._run is not None:
            self._run.stop()

    # what a progress bar follows

    @property
    def share(self) -> float | None:
        """0 to 1."""
        return self._task.share if self._task else None

    @property
    def seconds_left(self) -> float | None:
        """s; of a loop against the clock what is planned, without the time that its start took. None while it saves."""
        if self.result is not None:
            return None
        if self.real_time and self._run is not None and not self._run.done:
            taken, of = self._run.progress
            return (of - taken) * self._run.plan.T if taken else None
        return self._task.seconds_left if self._task else None

    @property
    def note(self) -> str:
        """What it does now."""
        return self._task.note if self._task else ""

    @property
    def done(self) -> bool:
        """Whether it is over, and its tables are saved."""
        return self._task is not None and self._task.done

    @property
    def written(self) -> bool:
        """Whether its pictures and reports are there, too, or never will be."""
        return self.done and (self._writing is None or self._writing.done)

    @property
    def unwritten(self) -> BaseException | None:
        """Why its pictures and reports could not be made."""
        return self._writing.error if self._writing is not None else None

    def stop(self) -> None:
        """Ask for a safe end; what was recorded is kept."""
        if self._task is not None:
            self._task.stop()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is over and all its files are written; false after `timeout` s, for each of the two."""
        over = self._task is None or self._task.wait(timeout)
        return over and (self._writing is None or self._writing.wait(timeout))

    @property
    def error(self) -> BaseException | None:
        """Why it failed; None where it was only stopped."""
        return None if self._task is None or self._task.stopped else self._task.error

    @property
    def stopped_early(self) -> bool:
        """Whether it was stopped before its loop began."""
        return self._task is not None and self._task.stopped

    # what happens meanwhile

    def traces(self) -> list[tuple[str, str]]:
        """The names and units of what `new_rows` gives beside the time; none before the loop has begun."""
        columns, units = self._columns()
        found = [(name, units.get(name, "")) for name in shown(columns)]
        found += [(f"{axis}_error", units.get(f"{axis}_measured", "")) for axis in followed(columns)]
        return [*found, ("contour_error", "mm")] if columns and self.prepared is not None else found

    def new_rows(self) -> np.ndarray:
        """Rows recorded since it was last asked: time in s, then one column per trace."""
        columns, _ = self._columns()
        rows = self._new(columns)
        if not len(rows):
            return np.empty((0, 1 + len(self.traces())))
        if self.prepared is not None:
            rows = rows[:: max(round(1.0 / (STRIP_RATE * self.prepared.T)), 1)]
        of = dict(zip(columns, rows.T, strict=True))
        errors = [of[f"{axis}_reference"] - of[f"{axis}_measured"] for axis in followed(columns)]
        if self.prepared is not None:
            errors.append(contour_errors(of, self.prepared))
        return np.column_stack([of["time"], *(of[name] for name in shown(columns)), *errors])

    def _columns(self) -> tuple[list[str], Mapping[str, str]]:
        if self.result is not None:
            return list(self.result.columns), self.result.units
        if self._run is None or not self._run.columns:
            return [], {}
        return ["time", *self._run.columns[1:]], self._run.units

    def _new(self, columns: Sequence[str]) -> np.ndarray:
        """Rows of `columns` that were not asked for yet."""
        if self.result is not None:
            seen, self._seen = self._seen, len(self.result)
            return np.column_stack([self.result[name][seen:] for name in columns])
        if self._run is None or not columns:
            return np.empty((0, 0))
        first, rows = self._run.read(self._seen)
        self._seen = first + len(rows)
        # the record counts samples, in its first column
        return np.column_stack([rows[:, 0] * self._run.plan.T, rows[:, 1:]])

    @property
    def live_values(self) -> dict[str, Any]:
        """What can be changed now, by name: the controllers' parameters, and hold and override of a path.

        None before and after the loop.
        """
        if self._run is None or self._run.done or not self._run.columns:
            return {}
        channels = self._run.live_values.channels
        return {name: channel for name, channel in channels.items() if "." in name or name in (HOLD, OVERRIDE)}

    def change(self, name: str, value: float) -> None:
        """Change a live value from the next sample on; InputError where that will not do, or when it is over."""
        if self._run is None:
            raise InputError("the run has not begun")
        self._run.live_values.set(name, value)

    @property
    def changes(self) -> list[Any]:
        """The changes that the loop has taken: time in s, name, old value, new value each."""
        return list(self._run.changes) if self._run is not None else []


def _recorded(folder: Path) -> Result | None:
    """What a loop against the clock recorded until it failed, saved as tables; None where it has no sample."""
    try:
        result = open_result(folder)
        if len(result):
            result.save(folder)
    except InputError:
        return None
    return result if len(result) else None


def contour_errors(of: Mapping[str, np.ndarray], prepared: Prepared) -> np.ndarray:
    """How far each measured position is from the path, mm; `of` are some rows of a run, as columns."""
    from rds.nc.run.judge import contour, located

    return contour(of, located(of, prepared), of["program_state"].astype(int))


def shown(columns: Sequence[str]) -> list[str]:
    """The columns that a strip shows: of each axis its motion, and its voltage."""
    return [name for kind in _KINDS for name in columns if name.endswith(f"_{kind}")]


def followed(columns: Sequence[str]) -> list[str]:
    """The axes that follow a reference."""
    return [
        name.removesuffix("_reference")
        for name in columns
        if name.endswith("_reference") and f"{name.removesuffix('_reference')}_measured" in columns
    ]


def _name(axes: Sequence[str], mode: str) -> str:
    return f"{time.strftime('%Y%m%d-%H%M%S')}-{'-'.join(axes)}-{mode}-{secrets.token_hex(4)}"
