"""A part program that a panel runs: an operator's hand on it, and what happens meanwhile."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.modes.loop.execution import State
from rds.modes.loop.program import SINGLE_STEP
from rds.nc.run.report import save_run
from rds.nc.run.run import PartProgram, ProgramRun, Status
from rds.nc.setup import Setup
from rds.panels.equipment.run import STRIP_RATE, EquipmentRun, contour_errors
from rds.panels.program.stock import Cut
from rds.panels.session.session import RUNS, Session
from rds.panels.session.task import Task
from rds.results import Result

_MOVED = ("_reference", "_measured", "_modelled")


class ProgramWork(EquipmentRun):
    """One run of the program in `file`, in the session's folder. `start()` returns at once.

    While it runs: `status()`, `hold()`, `resume()`, `override(share)`, `home()`, `stop()`; `held` says whether it was
    asked to hold. A simulation takes no longer than it must, and is only stopped.
    """

    def __init__(
        self,
        session: Session,
        file: Path,
        mode: str,
        setup: Setup,
        controller: Any,
        changes: list[tuple[float, str, float]],
        prepare: Callable[[Callable[[], None]], object] | None = None,
        motion: Mapping[str, Any] | None = None,
    ):
        """`motion` is what `PartProgram` is told of an interpolator, or of a run in part; else nothing."""
        super().__init__(session, {"mode": mode}, f"{file.name}, {mode}", prepare)
        self.file, self.mode = file, mode
        self.folder = session.folder / RUNS / f"{time.strftime('%Y%m%d-%H%M%S')}-{file.stem}-{self.folder.name[-4:]}"
        self._setup, self._controller, self._changes = setup, controller, changes
        self._motion = dict(motion or {})
        self.cut: Cut | None = None  # what the program makes of its stock, where that is known

    def _work(self, task: Task[Result]) -> Result:
        with contextlib.ExitStack() as held:
            try:
                self._await_turn(task, held)
                if self._prepare is not None:
                    self._prepare(lambda: self._tell(task, "checking the controller's file"))
                self._tell(task, "reading the program" if "interpolator" in self._motion else "planning the program")
                part = PartProgram(
                    self.file,
                    self.session.machine,
                    setup=self._setup,
                    controller=self._controller,
                    mode=self.mode,
                    **self._motion,
                )
                self.plan, self.prepared = part.plan(), part.prepared
                self._tell(task, "starting the loop" if self.real_time else "simulating")
                return self._follow(
                    *(task, held, lambda: part.start(out=self.folder, changes=self._changes)),
                    lambda taken, of, note: task.advance(taken, max(of, taken), note),
                )
            finally:
                self.session.give_machine_back(self)
                if self.result is not None and "program" in self.result.meta:
                    self._write_files(save_run, self.result, self.prepared, self.folder, held=held)

    # what a progress bar follows: waiting is no progress

    @property
    def share(self) -> float | None:
        """0 to 1 of the planned samples; before the first one as the work says."""
        status = self.status()
        return super().share if status is None else status.share

    @property
    def seconds_left(self) -> float | None:
        """s, at the rate of now; None while it waits or rests."""
        status = self.status()
        if status is None or self.prepared is None:
            return super().seconds_left
        return self.prepared.seconds * (1.0 - status.share) / status.rate if status.rate > 0.01 else None

    # an operator's hand

    @property
    def program_run(self) -> ProgramRun:
        """The run that goes on; InputError before it begins and when it is over."""
        run = self._run
        if not isinstance(run, ProgramRun) or run.done:
            raise InputError("no program runs now")
        return run

    @property
    def operable(self) -> bool:
        """Whether it can be held, overridden and so on now."""
        return self.real_time and self._goes_on

    @property
    def _goes_on(self) -> bool:
        run = self._run
        return isinstance(run, ProgramRun) and not run.done and bool(run.columns)

    @property
    def waits(self) -> bool:
        """Whether it waits for Resume: at a stop, or for its tool. A simulation is given its tools at once."""
        status = self.status() if self._goes_on else None
        if status is not None and status.state is State.TOOL and not self.real_time:
            with contextlib.suppress(InputError):  # it has gone on, and ended
                self.resume()
            return False
        return status is not None and status.state in (State.STOP, State.TOOL)

    @property
    def held(self) -> bool:
        """Whether somebody has asked it to hold."""
        try:
            return bool(self.program_run.live_values["hold"])
        except InputError:
            return False

    def hold(self) -> None:
        """Come to rest on the path."""
        self.program_run.hold()

    def resume(self) -> None:
        """Go on after a hold, M0, M1 or a tool change."""
        self.program_run.resume()

    def override(self, share: float) -> None:
        """Feed as a multiple of the programmed one, 0 to 2."""
        self.program_run.override(share)

    @property
    def steps(self) -> bool:
        """Whether it can rest after each line."""
        return self.operable and SINGLE_STEP in self.program_run.live_values

    def step(self, on: bool) -> None:
        """Rest after each line from now on, or no more."""
        self.program_run.live_values.set(SINGLE_STEP, float(on))

    def home(self) -> None:
        """End the program where it is, and move home."""
        self.program_run.home()

    def status(self) -> Status | None:
        """Where it is; None before the first sample and when it is over."""
        run = self._run
        return run.status() if isinstance(run, ProgramRun) and not run.done else None

    # the strip, and the machine

    def moved(self) -> list[tuple[str, str]]:
        """What `new_rows` gives after the traces: the motion of the axes that the program moves, and of the spindle;
        and the number of the tool where it is known what the program cuts.
        """
        columns, units = self._columns()
        found = [(name, units.get(name, "")) for name in columns if name.endswith(_MOVED)]
        return found if self.cut is None else [*found, ("tool", "")]

    def traces(self) -> list[tuple[str, str]]:
        """The following error of each axis, and the contour error; none before the loop has begun."""
        columns, units = self._columns()
        if self.prepared is None or not columns:
            return []
        axes = self.prepared.program.axes
        found = [(f"{axis}_error", units.get(f"{axis}_measured", "mm")) for axis in axes]
        return [*found, ("contour_error", "mm")]

    def new_rows(self) -> np.ndarray:
        """Rows since it was last asked, thinned to STRIP_RATE: time in s, the traces, then what has `moved`."""
        columns, _ = self._columns()
        rows = self._new(columns)
        prepared = self.prepared
        if not len(rows) or prepared is None:
            return np.empty((0, 1 + len(self.traces()) + len(self.moved())))
        of = dict(zip(columns, rows[:: max(round(1.0 / (STRIP_RATE * prepared.T)), 1)].T, strict=True))
        errors = [of[f"{axis}_reference"] - of[f"{axis}_measured"] for axis in prepared.program.axes]
        if self.cut is not None:
            of["tool"] = self.cut.tool_of(of["program_line"])
        moved = [of[name] for name, _ in self.moved()]
        return np.column_stack([of["time"], *errors, contour_errors(of, prepared), *moved])
