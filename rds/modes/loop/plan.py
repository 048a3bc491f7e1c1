"""What a run consists of, in a form that can be handed to a process of its own."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any

from rds.core.clock import LatePolicy
from rds.core.errors import InputError
from rds.core.portable import portable
from rds.core.types import Controller, Ending, Model
from rds.core.values import has_nan
from rds.machines import Axis, Machine
from rds.machines.converter import converter
from rds.modes.loop.changes import LiveChanges, plan_changes, stop_channel
from rds.modes.loop.commands import Command, limiter
from rds.modes.loop.execution import Execution, Follower
from rds.modes.loop.following_error import ErrorLimits, FollowingGuard, Watched
from rds.modes.loop.force_guard import Cell
from rds.modes.loop.interpolated import Interpolated
from rds.modes.loop.laws import LiveReference, ReferenceSamples, controlled, coupled, played
from rds.modes.loop.live_values import Channel
from rds.modes.loop.loop import Law
from rds.modes.loop.program import InterpolatedProgram, Program, program_channels, program_columns
from rds.modes.loop.retimed import RetimedProgram
from rds.modes.loop.tuning import Tuning
from rds.network.delays import Network

_UNBOUNDED = 1 << 50  # samples


@dataclass(frozen=True)
class AxisPlan:
    """One axis of a run: its model, and a controller with a reference (unless a program gives it) or a signal.

    `command` is what the controller hands out; targets of a drive's own loop are kept within ±`most_target`.
    """

    axis: Axis
    model: Model
    controller: Controller | None = None
    reference: ReferenceSamples | None = None
    signal: Sequence[float] | None = None  # V at every sample
    command: Command = Command.VOLTAGE
    most_target: float = inf  # in the command's unit
    following_error: ErrorLimits | None = None

    @property
    def acting(self) -> str:
        """The column of what acted on the axis."""
        return f"{self.axis.name}_{self.command.acting}"

    @property
    def signals(self) -> dict[str, str]:
        """What its controller tells besides the voltage, with the units."""
        return {} if self.controller is None else dict(self.controller.signals)


@dataclass(frozen=True)
class Plan:
    """A run: mode, axes and everything that the loop is built from. Times in s."""

    mode: str
    machine: Machine
    axes: tuple[AxisPlan, ...]
    T: float
    samples: int
    saturation: bool = True
    quantization: bool = True
    bus: dict[str, Any] = field(default_factory=dict)  # keyword arguments of can.Bus
    late: LatePolicy = field(default_factory=LatePolicy)
    late_limit: int = 0
    priority: int = 80  # of SCHED_FIFO
    cpu: int | None = None  # pin the target to this processor
    rehearsal: float = 0.25  # s of clock and I/O without the student's code, before a real-time run
    import_path: tuple[str, ...] = ()  # folders of the students' files, for what they import from there
    changes: tuple[tuple[int, str, float], ...] = ()  # of live values: (sample, channel, value), in order
    network: Network | None = None  # between the axes and their controllers
    program: Program | InterpolatedProgram | None = None  # instead of references; `samples` is what it takes unhindered
    notes: tuple[str, ...] = ()  # for the result, from before the run

    @property
    def names(self) -> list[str]:
        """The axes' names, in axis order."""
        return [plan.axis.name for plan in self.axes]

    @property
    def controlled(self) -> bool:
        """Whether controllers drive the axes (otherwise voltage signals do)."""
        return self.axes[0].signal is None

    @property
    def most_samples(self) -> int:
        """After so many samples the run ends in any case; a program waits for as long as somebody lets it."""
        return self.samples if self.program is None else _UNBOUNDED

    def limits(self) -> list[Callable[[Any], float]]:
        """What each axis's commands go through: the converter of this run, or the limits of a drive's target."""
        board = self.machine.converter
        volts = converter(board.range, board.bits, saturation=self.saturation, quantization=self.quantization)
        return [
            volts
            if axis.command is Command.VOLTAGE
            else limiter(axis.command, axis.most_target, axis.command.unit(axis.axis.unit))
            for axis in self.axes
        ]

    def channels(self) -> list[Channel]:
        """What may be changed while it runs: the parameters of controllers, the override of a program, the stop."""
        steps = isinstance(self.program, Program) and self.program.steps
        own = [] if self.program is None else program_channels(steps)
        return [channel for tuning in self._tunings() for channel in tuning.channels] + own + [stop_channel()]

    def with_changes(self, changes: Iterable[Any]) -> Plan:
        """The same run, in which live values change at known times; see `changes.plan_changes`."""
        channels = {channel.name: channel for channel in self.channels()}
        return replace(self, changes=plan_changes(changes, channels, self.T))

    def verify(self, values: Mapping[str, float]) -> None:
        """InputError if a controller cannot be made with these live values."""
        for tuning in self._tunings():
            tuning.verify(values)

    def start(self, cell: Cell | None = None) -> Drive:
        """What drives the axes, fresh from its initial state, and what takes the changes of live values.

        `cell` is the machine's load cell, which a guarded program heeds.
        """
        tunings = self._tunings()
        actions = {name: act for tuning in tunings for name, act in tuning.actions().items()}
        params = [tuning.params for tuning in tunings]
        program, guard = self.program, self._guard()
        last = [] if guard is None else [guard.law]
        if program is None:
            references = [plan.reference for plan in self.axes if plan.reference is not None]
            changes = LiveChanges(self.channels(), actions, self.changes, None if guard is None else guard.over)
            laws, notes = self._laws(params, references)
            return Drive([*laws, *last], changes, notes=notes)
        live = {name: LiveReference() for name in self.names}
        spindle = None if program.spindle is None else self.names.index(program.spindle)
        follower: Follower = (
            RetimedProgram(program, self.T) if isinstance(program, Program) else Interpolated(program, self.T)
        )
        execution = Execution(
            program,
            self.T,
            follower,
            [live[name] for name in (*program.axes, *([program.spindle] if program.spindle else []))],
            spindle,
            0.0 if spindle is None else self.axes[spindle].axis.resolution,
            lambda names: changes.expects(names),
            cell,
        )

        def ends() -> tuple[Ending, str] | None:
            return (guard.over() if guard is not None else None) or execution.over()

        def waits() -> bool:
            return (guard is None or guard.over() is None) and execution.waits()

        changes = LiveChanges(self.channels(), actions | execution.actions(), self.changes, ends, waits)
        laws, notes = self._laws(params, list(live.values()))
        return Drive([execution.law, *laws, *last], changes, sets_references=True, notes=notes)

    def unwatched(self) -> Plan:
        """The same run, that no following error ends: to go through it again, which ended where it did."""
        return replace(self, axes=tuple(replace(axis, following_error=None) for axis in self.axes))

    def _guard(self) -> FollowingGuard | None:
        """What ends the run where an axis is too far from its reference."""
        if all(plan.following_error is None for plan in self.axes):
            return None
        columns, _ = self.columns(None)
        watched = [
            Watched(plan.axis.name, plan.axis.unit, allowed, columns.index(f"{plan.axis.name}_reference"))
            for plan in self.axes
            if (allowed := plan.following_error) is not None
        ]
        return FollowingGuard(watched, [i for i, p in enumerate(self.axes) if p.command is Command.VOLTAGE], self.T)

    def _groups(self) -> list[list[int]]:
        """The axes under one law, in axis order: those of a coupled controller together, every other one alone."""
        controllers = [plan.controller for plan in self.axes]
        together = [i for i, each in enumerate(controllers) if each is not None and each.coupled]
        alone = [[i] for i in range(len(self.axes)) if i not in together]
        return sorted([together, *alone]) if together else alone

    def _tunings(self) -> list[Tuning]:
        """The live parameters of each controller; a coupled one has them once."""
        found = []
        for first, *_ in self._groups():
            axis, controller = self.axes[first].axis, self.axes[first].controller
            if controller is not None:
                name = "controller" if controller.coupled else axis.name
                found.append(Tuning(name, controller) if controller.coupled else Tuning(name, controller, axis.unit))
        return found

    @property
    def repeatable(self) -> bool:
        """Whether the laws answer the same when the run is gone through again."""
        return all(plan.controller is None or plan.controller.repeatable for plan in self.axes)

    @property
    def plant_columns(self) -> list[tuple[int, str, str]]:
        """What is recorded of the models where they are the plant: axis, attribute of its motion, unit.

        The velocity where a law tells signals, as an estimate is then held against it; and what a model tells itself.
        Without either a result has the columns that it always had.
        """
        signals = any(plan.controller is not None and plan.controller.signals for plan in self.axes)
        found = []
        for i, plan in enumerate(self.axes):
            if signals and plan.model.has_velocity and not plan.axis.is_spindle:
                found.append((i, "velocity", f"{plan.axis.unit}/s"))
            found += [(i, name, unit) for name, unit in plan.model.told.items()]
        return found

    def _laws(
        self, params: list[dict[str, Any]], references: Sequence[ReferenceSamples | LiveReference]
    ) -> tuple[list[Law], Callable[[], list[str]]]:
        """The laws, and what gives the notes on their states once the run is at its end."""
        limits, plans, names = self.limits(), self.axes, self.names
        laws, own = [], iter(params)
        states: list[Callable[[], Any]] = []
        owners: list[str] = []
        for group in self._groups():
            first = group[0]
            signal, controller = plans[first].signal, plans[first].controller
            if signal is not None:
                laws.append(played(first, signal, limits[first]))
                continue
            assert controller is not None
            command = _command_of([plans[i] for i in group])
            watched = None if has_nan(controller.initial_state) else states
            owners += [", ".join(names[i] for i in group)] if watched is not None else []
            if controller.coupled:
                of_group = ([names[i] for i in group], controller, [references[i] for i in group])
                laws.append(coupled(group, *of_group, self.T, [limits[i] for i in group], next(own), command, watched))
            else:
                of_axis = (first, names[first], controller, references[first], self.T, limits[first])
                laws.append(controlled(*of_axis, next(own), command, watched))
        return laws, lambda: [
            _of_lost_state(name) for name, state in zip(owners, states, strict=True) if has_nan(state())
        ]

    def columns(self, followed: str | None, simulates_plant: bool = False) -> tuple[list[str], dict[str, str]]:
        """The names of a record's columns in the order of the loop's rows, and their units.

        `followed` names what the loop's models give besides ("modelled"), if they give anything; `simulates_plant`
        says that they are the plant. InputError if two columns have one name.
        """
        columns = ["sample"]
        units = {"sample": ""}
        if self.program is not None:
            of_program = program_columns(self.program)
            columns += of_program
            units |= of_program
        for plan in self.axes:
            name, unit = plan.axis.name, plan.axis.unit
            # behind a network the law has what has arrived, which is not where the axis is
            heard = "measured" if self.network is None else "received"
            parts = {heard: unit, "command": plan.command.unit(unit)}
            if self.controlled:
                rates = {"reference_velocity": f"{unit}/s", "reference_acceleration": f"{unit}/s²"}
                parts = {"reference": unit, **rates, **parts, **plan.signals}
            for part, part_unit in parts.items():
                columns.append(f"{name}_{part}")
                units[columns[-1]] = part_unit
        for plan in self.axes:
            columns.append(plan.acting)
            units[columns[-1]] = plan.command.unit(plan.axis.unit)
        for plan in self.axes if followed else ():
            columns.append(f"{plan.axis.name}_{followed}")
            units[columns[-1]] = plan.axis.unit
        for i, part, unit in self.plant_columns if simulates_plant else ():
            columns.append(f"{self.axes[i].axis.name}_plant_{part}")
            units[columns[-1]] = unit
        for plan in self.axes if self.network is not None else ():
            for part, part_unit in (("measured", plan.axis.unit), *((f"delay_{of}", "s") for of in ("sc", "c", "ca"))):
                columns.append(f"{plan.axis.name}_{part}")
                units[columns[-1]] = part_unit
        if len(units) < len(columns):
            twice = next(name for name in columns if columns.count(name) > 1)
            raise InputError(f"two columns of the run are called {twice!r}; give the signal another name")
        return columns, units


def _command_of(plans: Sequence[AxisPlan]) -> tuple[str, str]:
    """What a law of these axes hands out, and its unit, for people: of one kind, or the kinds of the axes in order."""
    kinds = [(plan.command.quantity, plan.command.unit(plan.axis.unit)) for plan in plans]
    what, unit = ({kind[i]: None for kind in kinds} for i in (0, 1))
    return " or ".join(what), " or ".join(unit)


def _of_lost_state(name: str) -> str:
    """A voltage may stay finite on a state that holds NaN: min() and max() turn it into a limit."""
    return (
        f"the state of the controller of {name} holds NaN at the end of the run, so its voltages may not be what was "
        "meant; look for a division by zero, a root, a logarithm or inf - inf (`rds check` tells since when)"
    )


@dataclass(frozen=True)
class Drive:
    """What drives the axes of a run that has begun: its laws, and what takes the changes of live values."""

    laws: list[Law]
    changes: LiveChanges
    sets_references: bool = False  # the first of the laws sets the references of the others
    notes: Callable[[], list[str]] = list  # for the result, once the run is at its end


def dump(plan: Plan) -> bytes:
    """The plan as bytes for a process of the same user.

    A student's functions travel by value; modules that can be imported here can be imported there as well.
    """
    # Twice: the folders are needed before the rest can be read.
    return portable([*plan.import_path, *sys.path]) + portable(plan)


def load(path: Path) -> Plan:
    """The plan that `dump` wrote to a file; its folders come last in `sys.path`.

    InputError for a file that somebody else could have written: reading a plan runs code that is in it.
    """
    import pickle

    with open(path, "rb") as file:
        about = os.fstat(file.fileno())
        if hasattr(os, "geteuid") and (about.st_uid != os.geteuid() or about.st_mode & 0o022):
            raise InputError("was not written by this run alone; choose a folder that only you can write to", str(path))
        folders = [str(Path(folder).resolve()) for folder in pickle.load(file)]
        sys.path += [folder for folder in dict.fromkeys(folders) if folder not in sys.path]
        plan = pickle.load(file)
    assert isinstance(plan, Plan)
    return plan
