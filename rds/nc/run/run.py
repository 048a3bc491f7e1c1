"""A part program as an experiment: the same modes, controllers and results, with the program as the reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import hypot
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.machines import Machine, load_machine
from rds.modes.experiment import Experiment
from rds.modes.experiment.experiment_file import EXPERIMENT
from rds.modes.experiment.resolve import resolve
from rds.modes.experiment.run import Run
from rds.modes.loop.execution import State
from rds.modes.loop.plan import Plan
from rds.modes.loop.program import HOLD, HOME, OVERRIDE, RESUME
from rds.modes.process.host import Progress
from rds.modes.process.live import Live
from rds.nc.check import Setup
from rds.nc.run.judge import judged
from rds.nc.run.path import WORDS, as_prepared, method_of, of_part_program
from rds.nc.run.prepare import SPINDLE_UNIT, prepare
from rds.results import Result

AXES_CONTROLLER = {"name": "tracking"}
SPINDLE_CONTROLLER = {"name": "pid"}


@dataclass(frozen=True)
class Status:
    """Where a program is: line, state, rate of the feed (1: as programmed), seconds, axes measured and wanted."""

    time: float  # s
    line: int
    state: State
    rate: float
    feed: float  # mm/min along the path, as wanted
    share: float  # of the planned samples that are done
    measured: dict[str, float]
    reference: dict[str, float]


class ProgramRun(Run):
    """A part program that runs. `desk` has all its live values; the verbs here are those of an operator."""

    def hold(self) -> None:
        """Come to rest on the path."""
        self.desk.set(HOLD, 1.0)

    def resume(self) -> None:
        """Go on after a hold, M0, M1 or a tool change."""
        self.desk.set_all({HOLD: 0.0, RESUME: self.desk[RESUME] + 1.0})

    def override(self, share: float) -> None:
        """Feed as a multiple of the programmed one, 0 to 2."""
        self.desk.set(OVERRIDE, share)

    def home(self) -> None:
        """End the program where it is, held or not, and move home: up first, then straight."""
        self.desk.set_all({HOME: 1.0, HOLD: 0.0})

    def status(self) -> Status | None:
        """Where it is, by its last sample; None before the first."""
        columns = self.columns
        if not columns:
            return None
        _, rows = self.read(max(self.progress[0] - 1, 0))
        if not len(rows):
            return None
        of = dict(zip(columns, rows[-1].tolist(), strict=True))
        program = self.plan.program
        assert program is not None
        return Status(
            time=of["sample"] * self.plan.T,
            line=int(of["program_line"]),
            state=State(int(of["program_state"])),
            rate=of["program_override"],
            feed=60.0 * hypot(*(of[f"{name}_reference_velocity"] for name in program.axes if name in "XYZ")),
            share=min((of["program_sample"] + 1.0) / program.samples, 1.0),
            measured={name: of[f"{name}_measured"] for name in self.plan.names},
            reference={name: of[f"{name}_reference"] for name in self.plan.names},
        )


class PartProgram(Experiment):
    """A part program on the axes of a machine, the spindle included.

    `file` is the program; `machine` its name or file; `setup` what the program is read with (tool table, parameters,
    options of the dialect). Each position axis follows under `controller` (default: tracking), the spindle under PID; a
    table of an experiment file (`experiment`) says more: controllers and models of single axes, interface, timing, bus.

    With `interpolator` (a name of the library, the path of a student's .py file, a function, or a table with
    `interpolator`, `params` and `look_ahead`) its moves are not planned: the interpolator makes the samples inside the
    loop, with `acceleration` (a filter's name, or a table with `name` and `time`) on top, and at rest at the end of
    each segment if `exact_stop`.

        part = PartProgram("part.ngc")
        result = part.run()
        run = part.start("emulation")

    Raises InputError, with all faults by line, for a program that the machine cannot run.
    """

    def __init__(
        self,
        file: str | Path,
        machine: str | None = None,
        *,
        setup: Setup | None = None,
        controller: Any = None,
        interpolator: Any = None,
        acceleration: Any = None,
        exact_stop: bool = False,
        experiment: str | Path | None = None,
        mode: str | None = None,
        sample_period: float | None = None,
        progress: Progress | None = None,
    ):
        words = TomlTable({}, EXPERIMENT) if experiment is None else TomlTable.open(experiment, EXPERIMENT)
        given = {"machine": machine, "mode": mode, "sample_period": sample_period, "controller": controller}
        for key, value in given.items():
            if value is not None and key in words.table and key not in ("mode", "controller"):
                raise InputError(f"{key} is given here and beside the file; give it once", words.place(key))
        table = words.table | {key: value for key, value in given.items() if value is not None}
        self._folder = Path.cwd() if experiment is None else Path(experiment).resolve().parent
        self._machine = _load(str(table.get("machine", "mini-cnc")), self._folder)
        table.setdefault("controller", AXES_CONTROLLER)
        self._words = words.over_written(_with_spindle(table, self._machine))
        T = self._words.read("sample_period", self._machine.sample_period)
        if interpolator is None:
            for key, value in (("acceleration", acceleration), ("exact_stop", exact_stop)):
                if value:
                    raise InputError(f"{key} goes with interpolator, which is not given: planned motion needs neither")
            self.prepared = prepare(Path(file), self._machine, setup, T, progress)
        else:
            how = {"interpolator": interpolator} if not isinstance(interpolator, dict) else dict(interpolator)
            how |= {} if acceleration is None else {"acceleration": acceleration}
            how |= {"exact_stop": True} if exact_stop else {}
            method = method_of(TomlTable(how, WORDS), Path.cwd())
            made = of_part_program(Path(file), self._machine, setup, T, method, progress)
            self.prepared = as_prepared(made, Path(file), T)
        self.plan()

    @classmethod
    def from_toml(cls, path: str | Path) -> Experiment:
        """An experiment file says no program: PartProgram(file, experiment=path)."""
        raise InputError("an experiment file names no part program; PartProgram(file, experiment=path)", str(path))

    def start(
        self, mode: str | None = None, *, out: str | Path | None = None, changes: Iterable[Any] = ()
    ) -> ProgramRun:
        """Begin, and return at once; as `Experiment.start`."""
        run = super().start(mode, out=out, changes=changes)
        assert isinstance(run, ProgramRun)
        return run

    def _handle(
        self, plan: Plan, folder: Path | None, work: Callable[[Live | None, Progress | None], Result]
    ) -> ProgramRun:
        return ProgramRun(plan, folder, work)

    def _resolve(self, mode: str | None) -> tuple[Plan, dict[str, Any]]:
        return resolve(self._words, self._folder, mode, self.prepared.program)

    def _complete(self, result: Result, plan: Plan) -> Result:
        return judged(result, self.prepared)


def _load(name: str, folder: Path) -> Machine:
    return load_machine(str(folder / name) if name.endswith(".toml") else name)


def _with_spindle(table: dict[str, Any], machine: Machine) -> dict[str, Any]:
    """The spindle has a controller of its own, unless the user gives it one: laws of positions don't suit it."""
    given = table.get("axis")
    if given is not None and not isinstance(given, dict):
        return table
    axes = {name: dict(words) if isinstance(words, dict) else words for name, words in (given or {}).items()}
    for axis in machine.axes.values():
        if axis.unit == SPINDLE_UNIT:
            own = axes.setdefault(axis.name, {})
            if isinstance(own, dict):
                own.setdefault("controller", SPINDLE_CONTROLLER)
            break
    return table | {"axis": axes}
