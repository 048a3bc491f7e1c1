"""A part program as an experiment: the same modes, controllers and results, with the program as the reference."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, hypot, inf
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.options import known_keywords
from rds.core.progress import Progress
from rds.core.quantities import Flag, Quantity, checked
from rds.core.shared_quantities import FREE_FEED, LOCKED_FEED, TIED_FEED
from rds.core.toml_table import TomlTable
from rds.core.types import SPINDLE_UNIT
from rds.interpolators.motion.segments import AXES, JOINTS
from rds.machines import Machine, load_machine
from rds.machines.forces.cut_file import CutFile, read_cut
from rds.modes.experiment import Experiment
from rds.modes.experiment.experiment import on_machine
from rds.modes.experiment.experiment_file import EXPERIMENT
from rds.modes.experiment.resolve import resolve
from rds.modes.experiment.run import Run
from rds.modes.loop.execution import State
from rds.modes.loop.plan import Plan
from rds.modes.loop.program import HOLD, HOME, OVERRIDE, RESUME, Program
from rds.modes.process.live import Live
from rds.nc.run.forces import program_forces
from rds.nc.run.judge import judged
from rds.nc.run.path import WORDS, as_prepared, method_of, of_part_program
from rds.nc.run.prepare import Prepared, prepare
from rds.nc.setup import Setup
from rds.results import Result

SPINDLE_CONTROLLER = {"name": "pid"}
_BEGIN = Quantity("line of the program to begin at; 0: at its head", low=0, whole=True)
LOCKS = {  # what is said of an override that does not act
    LOCKED_FEED: "locked at 100 % by the program's M49",
    TIED_FEED: "locked at 100 % while the feed follows the spindle",
}
_AHEAD = 1e-3  # s, over which the rate of the tip is taken


def usual_controller(machine: Machine) -> str:
    """The law of a machine's position axes where none is named.

    It is `tracking`, whose observer takes the velocity from the positions of several samples. An axis that has followed
    its voltage within one sample, as a pulse generator does, shows it none: then it is `pid`.
    """
    axes = [axis for axis in machine.axes.values() if not axis.is_spindle]
    return "tracking" if all(axis.model.get("tau", inf) > machine.sample_period for axis in axes) else "pid"


@dataclass(frozen=True)
class Status:
    """Where a program is: line, state, rate of the feed (1: as programmed), seconds, axes measured and wanted."""

    time: float  # s
    line: int
    state: State
    rate: float
    feed: float  # mm/min along the path, as wanted; of the tip, while G43.4 is on
    share: float  # of the planned samples that are done
    measured: dict[str, float]
    reference: dict[str, float]
    tip: dict[str, float] = field(default_factory=dict)  # X, Y, Z of the tool's tip on the work, while G43.4 is on
    to_go: dict[str, float] = field(default_factory=dict)  # to the end of the move, by axis; of moves of the joints
    whose_feed: float = FREE_FEED  # FREE_FEED, LOCKED_FEED or TIED_FEED


class ProgramRun(Run):
    """A part program that runs. `live_values` has all its live values; the verbs here are those of an operator."""

    prepared: Prepared | None = None

    def hold(self) -> None:
        """Come to rest on the path."""
        self.live_values.set(HOLD, 1.0)

    def resume(self) -> None:
        """Go on after a hold, M0, M1 or a tool change."""
        self.live_values.set_all({HOLD: 0.0, RESUME: self.live_values[RESUME] + 1.0})

    def override(self, share: float) -> None:
        """Feed as a multiple of the programmed one, 0 to 2."""
        self.live_values.set(OVERRIDE, share)

    def home(self) -> None:
        """End the program where it is, held or not, and move home: up first, then straight."""
        self.live_values.set_all({HOME: 1.0, HOLD: 0.0})

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
        tip, feed = self._tip(of)
        if feed is None:
            feed = 60.0 * hypot(*(of[f"{name}_reference_velocity"] for name in program.axes if name in "XYZ"))
        return Status(
            time=of["sample"] * self.plan.T,
            line=int(of["program_line"]),
            state=State(int(of["program_state"])),
            rate=of["program_override"],
            feed=feed,
            share=min((of["program_sample"] + 1.0) / program.samples, 1.0),
            measured={name: of[f"{name}_measured"] for name in self.plan.names},
            reference={name: of[f"{name}_reference"] for name in self.plan.names},
            tip=tip,
            to_go=self._to_go(of),
            whose_feed=self._whose_feed(of),
        )

    @cached_property
    def _changes_of_feed(self) -> list[tuple[int, float]]:
        """Where the feed becomes the operator's, the program's or the spindle's: behind a sample, or a segment."""
        program = self.plan.program
        if isinstance(program, Program):
            return [(each.sample, each.value) for each in program.happenings if each.kind == "override"]
        return [] if program is None else [(after + 2, whose) for after, whose in program.overrides]

    def _whose_feed(self, of: dict[str, float]) -> float:
        """FREE_FEED, LOCKED_FEED or TIED_FEED; the way home is free."""
        if int(of["program_state"]) == State.HOME:
            return FREE_FEED
        at = of["program_sample" if isinstance(self.plan.program, Program) else "program_segment"]
        return next((whose for due, whose in reversed(self._changes_of_feed) if due <= at), FREE_FEED)

    def _to_go(self, of: dict[str, float]) -> dict[str, float]:
        """How far each axis is from the end of the move that goes on; nothing on the way home, or if unknown."""
        prepared, state = self.prepared, int(of["program_state"])
        if prepared is None or state in (State.HOME, State.OVER) or not len(prepared.segment):
            return {}
        row = min(max(ceil(of["program_sample"]), 0), len(prepared.segment) - 1)
        number = int(prepared.segment[row])
        if not 0 <= number < len(prepared.path) or prepared.path[number]["tip"] != JOINTS:
            return {}
        end = prepared.path[number]["end"]
        return {name: float(end[AXES.index(name)]) - of[f"{name}_measured"] for name in prepared.program.axes}

    def _tip(self, of: dict[str, float]) -> tuple[dict[str, float], float | None]:
        """Where the tip is on the work (mm), and its feed (mm/min) as wanted; nothing where joints are programmed."""
        prepared = self.prepared
        if prepared is None or prepared.tip is None or int(of["program_state"]) == State.HOME:
            return {}, None
        row = min(max(ceil(of["program_sample"]), 0), len(prepared.segment) - 1)
        segment = prepared.path[prepared.segment[row]]
        if segment["tip"] == JOINTS:
            return {}, None

        def place(kind: str, ahead: float = 0.0) -> Any:
            rates = [ahead * of[f"{name}_reference_velocity"] if ahead else 0.0 for name in prepared.program.axes]
            joints = np.zeros((1, len(AXES)))
            for name, rate in zip(prepared.program.axes, rates, strict=True):
                joints[0, AXES.index(name)] = of[f"{name}_{kind}"] + rate
            assert prepared.tip is not None
            return prepared.tip.tip.places(joints, float(segment["tool_length"]))[0][0]

        feed = 60.0 / _AHEAD * float(np.linalg.norm(place("reference", _AHEAD) - place("reference")))
        return dict(zip("XYZ", map(float, place("measured")), strict=True)), feed


class PartProgram(Experiment):
    """A part program on the axes of a machine, the spindle included.

    `file` is the program; `machine` its name or file; `setup` what the program is read with, a table of the files
    `tools` and `parameters`, of `correct` and of the dialect's options (`rds.nc.Setup`). Each position axis follows
    under `controller` (default: tracking), the spindle under PID; a table of an experiment file (`experiment`) says
    more: controllers and models of single axes, interface, timing, bus.

    With `interpolator` (a name of the library, the path of a student's .py file, a function, or a table with
    `interpolator`, `arc_interpolator`, `params` and `look_ahead`) its moves are not planned: the interpolator makes the
    samples inside the loop, with `acceleration` (a filter's name, or a table with `name` and `time`) on top, and at
    rest at the end of each segment if `exact_stop`. Else `profile` says how the motion is planned: "planned" (within
    the jerk, blending), "trapezoid", "blended" or "point-to-point".

    With `begin` (a line) it is run from there: the axes go up, across and down to where the first move of this line or
    a later one begins, with the tool, the spindle and the coolant of the lines before. With `steps` it comes to rest
    and waits after each line (single step) until `resume()`, while its live value `single_step` is 1; its motion is
    then "point-to-point" unless `profile` says otherwise. Both go with planned motion.

    With `cut` (a file, or a `CutFile`) the feed is lowered where the cutting force or a joint's load would exceed the
    limits of the cut, by the plan and by the load cell.

        part = PartProgram("part.ngc")
        result = part.run()
        run = part.start("emulation")

    Raises InputError, with all faults by line, for a program that the machine cannot run.
    """

    @known_keywords
    def __init__(
        self,
        file: str | Path,
        machine: str | Path | None = None,
        *,
        setup: Setup | Mapping[str, Any] | None = None,
        controller: Any = None,
        interpolator: Any = None,
        acceleration: Any = None,
        exact_stop: bool = False,
        profile: str = "planned",
        begin: int = 0,
        steps: bool = False,
        cut: str | Path | CutFile | None = None,
        experiment: str | Path | None = None,
        mode: str | None = None,
        sample_period: float | None = None,
        progress: Progress | None = None,
    ):
        words = TomlTable({}, EXPERIMENT) if experiment is None else TomlTable.open(experiment, EXPERIMENT)
        machine = str(machine) if isinstance(machine, Path) else machine
        read_with = Setup.of(setup)
        given = {"machine": machine, "mode": mode, "sample_period": sample_period, "controller": controller}
        for key, value in given.items():
            if value is not None and key in words.table and key not in ("mode", "controller"):
                raise InputError(f"{key} is given here and beside the file; give it once", words.place(key))
        table = words.table | {key: value for key, value in given.items() if value is not None}
        self._folder = Path.cwd() if experiment is None else Path(experiment).resolve().parent
        self._machine = _load(str(table.get("machine", "mini-cnc")), self._folder)
        table.setdefault("controller", {"name": usual_controller(self._machine)})
        self._table = table
        self._words = words.over_written(_with_spindle(table, self._machine))
        T = self._words.read("sample_period", self._machine.sample_period)
        checked(_BEGIN, begin, "begin")
        for key, flag in (("exact_stop", exact_stop), ("steps", steps)):
            checked(Flag(""), flag, key)
        if interpolator is None:
            for key, value in (("acceleration", acceleration), ("exact_stop", exact_stop)):
                if value:
                    raise InputError(f"{key} goes with interpolator, which is not given: planned motion needs neither")
        elif begin or steps:
            raise InputError("begin and steps go with planned motion, and an interpolator makes it: leave them out")
        elif profile != "planned":
            raise InputError(f"profile = {profile!r} plans the motion, and an interpolator makes it: give one of them")

        def prepared(machine: Machine) -> Prepared:
            if interpolator is None:
                how = "point-to-point" if steps and profile == "planned" else profile
                made = prepare(Path(file), machine, read_with, T, progress, how, begin=begin, steps=steps)
            else:
                words = {"interpolator": interpolator} if not isinstance(interpolator, dict) else dict(interpolator)
                words |= {} if acceleration is None else {"acceleration": acceleration}
                words |= {"exact_stop": True} if exact_stop else {}
                method = method_of(TomlTable(words, WORDS), Path.cwd())
                made = as_prepared(of_part_program(Path(file), machine, read_with, T, method, progress), Path(file), T)
            return made if cut is None else _guarded(made, machine, cut)

        self._prepare = prepared
        self.prepared = prepared(self._machine)
        self.plan()

    def __repr__(self) -> str:
        program = self.prepared.program
        axes = ", ".join(program.axes)
        return f"<PartProgram {self.prepared.file.name} on {self._machine.name}: {axes}, {self.prepared.seconds:.6g} s>"

    @classmethod
    def from_toml(cls, path: str | Path) -> Experiment:
        """An experiment file says no program: PartProgram(file, experiment=path)."""
        raise InputError("an experiment file names no part program; PartProgram(file, experiment=path)", str(path))

    @classmethod
    def from_table(cls, table: Mapping[str, Any], folder: str | Path = ".") -> Experiment:
        """A table says no program, as an experiment file does not."""
        raise InputError("a table names no part program; PartProgram(file, experiment=path) takes its words of a file")

    def start(
        self, mode: str | None = None, *, out: str | Path | None = None, changes: Iterable[Any] = ()
    ) -> ProgramRun:
        """Begin, and return at once; as `Experiment.start`."""
        run = super().start(mode, out=out, changes=changes)
        assert isinstance(run, ProgramRun)
        return run

    def _put_on(self, machine: Machine, channel: str | None) -> None:
        self._table = on_machine(self._table, machine, channel)
        self._words = self._words.over_written(_with_spindle(self._table, machine))
        self._machine, self.prepared = machine, self._prepare(machine)

    def _handle(
        self, plan: Plan, folder: Path | None, work: Callable[[Live | None, Progress | None], Result]
    ) -> ProgramRun:
        run = ProgramRun(plan, folder, work)
        run.prepared = self.prepared
        return run

    def _resolve(self, mode: str | None) -> tuple[Plan, dict[str, Any]]:
        return resolve(self._words, self._folder, mode, self.prepared.program)

    def _complete(self, result: Result, plan: Plan) -> Result:
        return judged(result, self.prepared)


def _guarded(prepared: Prepared, machine: Machine, cut: str | Path | CutFile) -> Prepared:
    """The program with a guard that keeps the limits of the cut."""
    found = program_forces(prepared, machine, cut if isinstance(cut, CutFile) else read_cut(cut))
    if not found.cut.limits:
        raise InputError(
            "the cut has no [limits], and there is nothing to keep; give one, as in force = 40.0", str(cut)
        )
    assert isinstance(prepared.program, Program)
    notes = tuple(f"{warning}; the feed is lowered there" for warning in found.warnings())
    program = replace(prepared.program, guard=found.guard())
    return replace(prepared, program=program, notes=(*prepared.notes, *notes))


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
