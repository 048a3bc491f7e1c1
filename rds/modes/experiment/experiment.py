"""An experiment: which axes of which machine, driven by what, in which mode. Made in Python or from a TOML file."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from rds.core.errors import ContractError, InputError, MachineError, RdsError
from rds.core.folder_kept import folder_kept
from rds.core.last_made import LastMade
from rds.core.options import known_keywords
from rds.core.progress import Progress
from rds.core.toml_table import TomlTable
from rds.core.types import Ending
from rds.machines import Machine, load_machine
from rds.modes import DEFAULT, load_mode
from rds.modes.experiment.experiment_file import EXPERIMENT, PATHS, is_path
from rds.modes.experiment.folder import new_folder, require_writable
from rds.modes.experiment.outcome import outcome
from rds.modes.experiment.resolve import resolve
from rds.modes.experiment.run import Run
from rds.modes.experiment.validation import validated
from rds.modes.loop.changes import FILE as CHANGES
from rds.modes.loop.changes import as_text
from rds.modes.loop.plan import Plan
from rds.modes.process.host import FailedSimulation, Rows, run_plan
from rds.modes.process.live import Live
from rds.modes.process.record import write_whole
from rds.results import Result, save_all


class FailedRun(ContractError):
    """A student's code has failed in a simulation that is kept: `result` has the samples up to then, saved."""

    def __init__(self, reason: str, result: Result):
        super().__init__(reason)
        self.result = result


_NO_EXPERIMENTS = {  # by the file's ending
    ".py": "it is a Python file: an experiment names it, under [controller] as `file = ...`; `rds check` looks at it",
    **dict.fromkeys((".ngc", ".nc", ".tap", ".gcode"), "it is a part program: `rds nc run` runs it"),
}


class Experiment:
    """One or more axes of a machine, driven by controllers after references, or by voltage signals.

    The arguments are the keys of an experiment file (docs/experiments.md), with these liberties: `controller`
    may be a library name, the path of a student's .py file (text or Path) or the module imported from it, a function
    `control(t, r, y, state, params)`, `globals()` of a notebook that defines one, a python-control system, an
    `rds.Controller`, or a table (dict); `model` likewise with `derivatives` or `advance`; `reference` and `signal` a
    signal (`rds.sinusoid(5.0, 0.2)`), a function of time, or a table. `axis` may be one name or several; with several,
    `overrides` such as
    {"Y": {"controller": ...}} differ for one axis. `duration` is 10 s unless it is given; with a path as `reference`
    (`{"kind": "path", ...}`, docs/experiments.md) the path says how long the run lasts. What is wrong
    raises InputError at once.

        experiment = rds.Experiment(axis="X", reference=rds.sinusoid(5.0, 0.2), controller="my_controller.py")
        simulated = experiment.run()
        emulated = experiment.run("emulation")
    """

    @known_keywords
    def __init__(
        self,
        machine: str | Path = "mini-cnc",
        axis: str | Sequence[str] = "X",
        mode: str = DEFAULT,
        duration: float | None = None,
        sample_period: float | None = None,
        *,
        reference: Any = None,
        controller: Any = None,
        signal: Any = None,
        model: Any = None,
        overrides: Mapping[str, Mapping[str, Any]] | None = None,
        error_compensation: Mapping[str, float] | None = None,
        following_error: Mapping[str, float] | None = None,
        interface: Mapping[str, bool] | None = None,
        timing: Mapping[str, Any] | None = None,
        bus: Mapping[str, Any] | None = None,
        network: Mapping[str, Any] | None = None,
        compiled: bool = False,
        title: str | None = None,
    ):
        if duration is None and not is_path(reference):
            duration = 10.0
        given: dict[str, Any] = {
            "title": title,
            "machine": str(machine) if isinstance(machine, Path) else machine,
            "mode": mode,
            "duration": duration,
            "sample_period": sample_period,
            "reference": reference,
            "controller": controller,
            "signal": signal,
            "model": model,
            "error_compensation": error_compensation,
            "following_error": following_error,
            "interface": interface,
            "timing": timing,
            "bus": bus,
            "network": network,
            "compiled": compiled,
        }
        table = {key: value for key, value in given.items() if value is not None}
        if isinstance(axis, str) and not overrides:
            table["axis"] = axis
        else:
            table["axes"] = [axis] if isinstance(axis, str) else list(axis) if isinstance(axis, Iterable) else axis
            if overrides:
                table["axis"] = dict(overrides)
        self._words = TomlTable(table, EXPERIMENT)
        self._folder = Path.cwd()
        self.plan()

    def __repr__(self) -> str:
        table = self._words.table
        axis = table.get("axis", "X")
        axes = ", ".join(map(str, table.get("axes", [axis] if isinstance(axis, str) else axis)))
        seconds = f", {table['duration']:g} s" if isinstance(table.get("duration"), int | float) else ""
        machine = table.get("machine", "mini-cnc")
        return f"<{type(self).__name__}: {table.get('mode', DEFAULT)} of {axes} on {machine}{seconds}>"

    @classmethod
    def from_toml(cls, path: str | Path) -> Experiment:
        """The experiment that a file describes; the files that it names are looked for from its own folder."""
        if (instead := _NO_EXPERIMENTS.get(Path(path).suffix.lower())) and Path(path).is_file():
            raise InputError(instead, str(path))
        experiment = cls.__new__(cls)
        experiment._words = TomlTable.open(path, EXPERIMENT)
        experiment._folder = Path(path).resolve().parent
        experiment.plan()
        return experiment

    @classmethod
    def from_table(cls, table: Mapping[str, Any], folder: str | Path = ".") -> Experiment:
        """The experiment of a table that says what a TOML file would; files are looked for from `folder`."""
        experiment = cls.__new__(cls)
        experiment._words = TomlTable(dict(table), EXPERIMENT)
        experiment._folder = Path(folder).resolve()
        experiment.plan()
        return experiment

    @property
    def mode(self) -> str:
        """The mode that `run()` takes unless it is told another."""
        return str(self._words.table.get("mode", DEFAULT))

    @property
    def title(self) -> str | None:
        """What the user calls it."""
        title = self._words.table.get("title")
        return None if title is None else str(title)

    def with_model(self, model: Any) -> Experiment:
        """The same experiment with another model of its axis, given as for `Experiment`; controllers are designed anew.

        InputError for an experiment of several axes, each of which has a model of its own.
        """
        if len(self.plan().axes) > 1:
            raise InputError("it has several axes, each with a model of its own; name these in the experiment's file")
        table = self._words.table | {"model": model}
        if isinstance(own := table.get("axis"), dict):
            table["axis"] = {name: {key: each[key] for key in each if key != "model"} for name, each in own.items()}
        changed = copy.copy(self)
        changed._words = self._words.over_written(table)
        changed.plan()
        return changed

    def with_machine(self, machine: str | Path, channel: str | None = None) -> Experiment:
        """The same experiment on another machine: a name, or a machine's file as seen from here.

        `channel` is where its modules are, if not where the experiment says. InputError for a machine on which the
        experiment cannot be run, as one without its axes.
        """
        changed = copy.copy(self)
        changed._put_on(load_machine(str(machine)), channel)
        changed.plan()
        return changed

    def _put_on(self, machine: Machine, channel: str | None) -> None:
        self._words = self._words.over_written(on_machine(self._words.table, machine, channel))

    @property
    def periods(self) -> dict[str, float | None]:
        """The period of each axis's reference, s; None where it does not repeat. Metrics leave the first one out."""
        return dict(self._resolve(None)[1]["period"])

    def plan(self, mode: str | None = None) -> Plan:
        """What would run: every part made and checked. Raises InputError for what will not do."""
        return self._resolve(mode)[0]

    @known_keywords
    def run(
        self,
        mode: str | None = None,
        *,
        out: str | Path | None = None,
        progress: Progress | None = None,
        changes: Iterable[Any] = (),
    ) -> Result:
        """Run in `mode` (default: the experiment's own) and return the result.

        With `out`, the result is saved in that folder (CSV, MAT, Parquet); a real-time run keeps its raw record
        there while it runs, and in a new folder under `runs/` where none is given. `progress(samples taken, samples
        in all)` is called now and then. `changes` of live values, as (time in s, name, value), are made at their times;
        those of an earlier run are in its `meta["changes"]`, and repeat it in a simulation sample for sample.

        Raises ContractError if the student's code breaks its contract or raises, and MachineError if the machine
        was never there; the samples of a real-time run are kept in its record. A run that ended early for another
        reason says so in the result's `meta["ending"]`.
        """
        run = self._prepared(mode, out, changes)
        return run.start().wait(progress) if load_mode(run.plan.mode).real_time else run.here(progress)

    @known_keywords
    def start(self, mode: str | None = None, *, out: str | Path | None = None, changes: Iterable[Any] = ()) -> Run:
        """Begin to run in `mode`, and return at once: a handle on the run, which can be watched, changed and stopped.

            run = experiment.start("emulation")
            run.ready()
            run.live_values.set("X.Pgain", 30.0)
            result = run.wait()

        `out` and `changes` as for `run`. Raises InputError for what will not do; the run's own errors come from
        `wait()`. A simulation takes no more time than it needs, so there is little to watch in it.
        """
        return self._prepared(mode, out, changes).start()

    def _prepared(self, mode: str | None, out: str | Path | None, changes: Iterable[Any]) -> Run:
        plan, known = self._resolve(mode)
        plan = plan.with_changes(changes)
        if plan.program is None and plan.changes and (late := plan.changes[-1])[0] >= plan.samples:
            raise InputError(
                f"the change of {late[1]} at {late[0] * plan.T:g} s comes after the run, which lasts "
                f"{plan.samples * plan.T:g} s; make it earlier, or the run longer"
            )
        if out is not None:
            require_writable(out)
            folder: Path | None = Path(out)
        else:
            folder = new_folder(plan.names, plan.mode) if load_mode(plan.mode).real_time else None

        def work(live: Live | None, progress: Progress | None) -> Result:
            try:
                with folder_kept():
                    rows = self._rows(plan, folder, progress, live)
            except FailedSimulation as error:
                if out is None or not len(error.rows.values):
                    raise
                kept = self._saved(plan, known, error.rows, out)
                said = f"{error} (the samples up to then are in {out})"
                raise FailedRun(said, kept) from error.__cause__
            return self._finished(plan, known, rows, folder, out)

        return self._handle(plan, folder, work)

    def _handle(self, plan: Plan, folder: Path | None, work: Callable[[Live | None, Progress | None], Result]) -> Run:
        return Run(plan, folder, work)

    def _finished(
        self, plan: Plan, known: dict[str, Any], rows: Rows, folder: Path | None, out: str | Path | None
    ) -> Result:
        if rows.ending is Ending.FAULT:
            kept = f" (the samples up to then are in {folder})" if len(rows.values) else ""
            raise ContractError(f"{rows.reason}{kept}")
        if not len(rows.values):
            raise (MachineError if rows.ending in (Ending.MACHINE_LOST, Ending.ADAPTER_LOST) else RdsError)(
                rows.reason or str(rows.ending)
            )
        return self._saved(plan, known, rows, out)

    def _saved(self, plan: Plan, known: dict[str, Any], rows: Rows, out: str | Path | None) -> Result:
        """The result of these rows, saved where somebody wants it."""
        result = self._complete(outcome(plan, rows, known), plan)
        if load_mode(plan.mode).validates:
            result = validated(plan, result)
        if out is not None:
            save_all(result, out)
            if rows.changes:
                write_whole(Path(out) / CHANGES, as_text(rows.changes).encode())
            else:
                (Path(out) / CHANGES).unlink(missing_ok=True)  # of an earlier run
        return result

    @cached_property
    def _planned(self) -> LastMade:
        """The path that was planned last, as its reference."""
        return LastMade()

    def _resolve(self, mode: str | None) -> tuple[Plan, dict[str, Any]]:
        return resolve(self._words, self._folder, mode, planned=self._planned)

    def _complete(self, result: Result, plan: Plan) -> Result:
        """What else is to be said of a result; a run of another kind adds to it."""
        if plan.program is not None:
            judged: Result = PATHS.module("path").judged_path(result, plan.program, plan.T)
            return judged
        return result

    def _rows(self, plan: Plan, folder: Path | None, progress: Progress | None, live: Live | None) -> Rows:
        note = None
        if self._words.read("compiled"):
            from rds.modes.experiment.compiled import obstacle, run_compiled

            note = obstacle(plan) or (None if live is None else "somebody may change it while it runs")
            if note is not None:
                note = f"not compiled: {note}"
            elif (compiled := run_compiled(plan)) is not None:
                return compiled
        rows = run_plan(plan, folder, progress, live)
        return replace(rows, notes=(note, *rows.notes)) if note else rows


def on_machine(table: Mapping[str, Any], machine: Machine, channel: str | None) -> dict[str, Any]:
    """The words of an experiment, with another machine and channel."""
    bus = {} if channel is None else {"bus": {**table.get("bus", {}), "channel": channel}}
    return {**table, "machine": str(Path(machine.path).resolve()), **bus}
