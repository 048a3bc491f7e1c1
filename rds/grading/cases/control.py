"""A controller's case: axes that follow a reference or a part program, as in an experiment file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.core.types import SPINDLE_UNIT, Controller, Model
from rds.grading.assignment.seeds import part_seed
from rds.grading.cases.case import COUNTS, LINEAR, Answers, CaseRun, Submitted
from rds.grading.cases.loop import LoopRun, asked, run_loop, with_parts
from rds.grading.cases.plant import Disturbance, disturbed, drawn_model, linear_model, noise_of, read_disturbance
from rds.grading.cases.words import CommonFields, as_own_file, inside, read_common, read_spread
from rds.grading.criteria.applied_force import begin_of, force, free_stretch
from rds.grading.criteria.linear import SWITCHES, LinearLoop, NoLoop, linear_loop, switches, switches_again
from rds.grading.grade import Status
from rds.grading.sandbox.errors import SubmissionError
from rds.identification.robustness.draws import Spread
from rds.identification.robustness.figures import voltage_limits
from rds.identification.robustness.uncertain import Uncertain, uncertain
from rds.machines import Axis, Machine, load_machine
from rds.machines.encoder import encoder
from rds.models import library_model
from rds.modes.experiment.resolve import resolve
from rds.modes.loop.plan import Plan

if TYPE_CHECKING:
    from rds.nc.run.prepare import Prepared

_NOT_HERE = ("mode", "controller", "bus", "network", "timing", "compiled", "signal")
_STANDS_IN = Controller(lambda t, r, y, state, params: (0.0, state))


@dataclass(frozen=True)
class ControlCase:
    """A plan with everything but the submission; the plants of each run are drawn from a student's seed."""

    common: CommonFields
    plan: Plan
    periods: dict[str, float | None]
    plants: tuple[Uncertain, ...]
    driven: tuple[str, ...]  # the axes that the submission drives
    is_coupled: bool
    params: dict[str, Any]
    disturbance: Disturbance | None
    noise: float  # of the same unit as the axes
    prepared: Prepared | None
    files: tuple[str, ...]

    name = property(lambda self: self.common.name)
    title = property(lambda self: self.common.title)
    is_visible = property(lambda self: self.common.is_visible)
    runs = property(lambda self: self.common.runs)

    @property
    def unit(self) -> str:
        """Of the axes."""
        return self.plan.axes[0].axis.unit

    @property
    def can_be_linearized(self) -> bool:
        """Whether each axis has a law of its own, and a model whose linear part is known."""
        return not self.is_coupled and all(linear_model(plant.base) is not None for plant in self.plants)

    @property
    def is_drawn(self) -> bool:
        """Whether a plant or the noise is drawn for each student."""
        return bool(self.noise) or any(plant.spread.names for plant in self.plants)

    def run(self, submitted: Submitted, seed: int, number: int, needs: Iterable[str] = ()) -> CaseRun:
        """The closed loop of run `number`; the linearized loop takes one more run of the same motion."""
        plan, subjects = self.plan, self._begin(submitted)
        models = [drawn_model(plant, seed, number) for plant in self.plants]
        actual: list[list[float]] = [[] for _ in models]
        meta = {"period": self.periods, "voltage_range": plan.machine.converter.range}
        done = run_loop(with_parts(plan, self._laws(subjects), self._disturbed(models, seed, number, actual)), meta)
        counts = subjects[0].counts if COUNTS in needs else None
        result = done.result
        if self.prepared is not None:
            from rds.nc.run.judge import judged

            result = judged(result, self.prepared)
        if self.noise:
            result = self._with_actual(result, actual)
        low, high, _ = voltage_limits(plan)
        facts = {"limits": (low, high), "noisy": bool(self.noise)}
        if self.disturbance is not None:
            facts["disturbed_from"] = self.disturbance.start
        linear = self._linear_or_why(submitted, models, done, seed, number) if LINEAR in needs else None
        return CaseRun(self.name, number, result, done.fault, counts, linear, facts)

    def _begin(self, submitted: Submitted) -> list[Answers]:
        names = self.driven
        groups = [list(names)] if self.is_coupled or len(names) == 1 else [[name] for name in names]
        subjects = [submitted.subject(number) for number in range(len(groups))]
        for subject, axes in zip(subjects, groups, strict=True):
            subject.begin_control(self.params, None, self.plan.T, tuple(axes))
        return subjects

    def _laws(self, subjects: list[Answers]) -> list[Controller | None]:
        if self.is_coupled:
            return [asked(subjects[0], True)] * len(self.plan.axes)
        of = {name: asked(subject, False) for name, subject in zip(self.driven, subjects, strict=True)}
        return [of.get(name) for name in self.plan.names]

    def _with_actual(self, result: Any, actual: list[list[float]]) -> Any:
        columns, units = dict(result.columns), dict(result.units)
        for axis, positions in zip(self.plan.axes, actual, strict=True):
            name, measure = axis.axis.name, encoder(axis.axis.resolution, quantization=self.plan.quantization)
            values = positions[: len(result)]
            columns[f"{name}_actual"] = np.array(values if measure is None else [measure(p) for p in values])
            units[f"{name}_actual"] = axis.axis.unit
        return type(result)(columns, units, result.meta)

    def _disturbed(
        self,
        models: list[Model],
        seed: int,
        number: int,
        actual: list[list[float]] | None = None,
        forces: Sequence[np.ndarray] | None = None,
    ) -> list[Model]:
        """The models of run `number` with their disturbance, `forces` (V, of each axis) and noise.

        `actual` is given the positions before the noise, of each axis.
        """
        voltage = None if self.disturbance is None else self.disturbance.voltage
        voltages = [voltage] * len(models)
        if forces is not None:
            voltages = [own if voltage is None else voltage + own for own in forces]
        return [
            disturbed(
                model,
                voltages[axis],
                noise_of(self.noise, self.plan.samples, seed, self.name, number, axis),
                actual[axis].append if self.noise and actual is not None else None,
            )
            for axis, model in enumerate(models)
        ]

    def _linear_or_why(
        self, submitted: Submitted, models: list[Model], done: LoopRun, seed: int, number: int
    ) -> tuple[LinearLoop | NoLoop, ...]:
        """As `_linear`; what breaks its interface only there loses its margins, and not the run that it has done."""
        try:
            return self._linear(submitted, models, done, seed, number)
        except SubmissionError as error:
            if error.status is not Status.BROKE_CONTRACT:
                raise
            said = f": {error.reason}" if self.is_visible else ""  # it could be what it saw of a hidden case
            return (NoLoop(f"under a force on the axis, it broke its interface{said}", True),)

    def _linear(
        self, submitted: Submitted, models: list[Model], done: LoopRun, seed: int, number: int
    ) -> tuple[LinearLoop | NoLoop, ...]:
        """The loop of each axis in run `number`, which is `done`, linearized: from one more run, under a force."""
        plan, low_high = self.plan, voltage_limits(self.plan)
        if done.fault:
            return (NoLoop(done.fault, True),)
        limit, stretches, forces = low_high[1], [], []
        for axis, (name, model) in enumerate(zip(plan.names, models, strict=True)):
            u, y = done.result[f"{name}_command"], done.result[f"{name}_measured"]
            stretches.append(free_stretch(u, y, limit))
            drawn = part_seed(seed, self.name, number, "force", *([axis] if axis else []))
            forces.append(force(model, u, (plan.machine.converter.range, limit), stretches[-1], drawn))
        laws = self._laws(self._begin(submitted))
        again = run_loop(with_parts(plan, laws, self._disturbed(models, seed, number, forces=forces)), {})
        if again.fault:
            return (NoLoop(f"under a force on the axis, {again.fault}", True),)
        found: list[LinearLoop | NoLoop] = []
        for name, model, stretch in zip(plan.names, models, stretches, strict=True):
            begin, ideal = begin_of(stretch, plan.samples), linear_model(model)
            assert ideal is not None  # by `can_be_linearized`, which the assignment has checked
            u, y = done.result[f"{name}_command"], done.result[f"{name}_measured"]
            same = again.result[f"{name}_command"][:begin] == u[:begin]
            # a relay where it is not measured, whatever it is elsewhere; or a law that shakes where nothing shakes it
            parts = [u[: stretch[0]], u[stretch[1] :], *([] if self.noise else [u])]
            if any(switches_again(each, limit) for each in parts):
                found.append(NoLoop(SWITCHES, True))
                continue
            part = slice(begin, stretch[1])
            with np.errstate(over="ignore"):  # of voltages that no converter has
                voltage = again.result[f"{name}_command"][part] - u[part]
            position = again.result[f"{name}_measured"][part] - y[part]
            loop = linear_loop(voltage, position, u[part], limit, ideal, plan.T)
            if not same.all():
                t = plan.T * int(np.argmin(same))
                why = (
                    f"at t = {t:.3f} s it answered the same samples otherwise in a second run; go by `t` and not by a "
                    "clock, keep memory in `state`, and give generators of random numbers a seed"
                )
                loop = NoLoop(why, switches(u, limit), loop if isinstance(loop, LinearLoop) else loop.nearest)
            found.append(loop)
        return tuple(found)


def read(words: TomlTable, folder: Path, machine: str) -> ControlCase:
    """A table `[[case]]` of a controller's assignment. InputError with its place for what will not do."""
    words = as_own_file(words, {"machine": machine})
    common = read_common(words)
    for key in _NOT_HERE:
        if key in words.table:
            raise InputError(f"{key} has no place in a case: it is a simulation of the submission", words.place(key))
    own = inside(words, "machine", folder) if str(words.any("machine")).endswith(".toml") else None
    rig = load_machine(str(folder / own) if own else words.read("machine"))
    prepared, files = _program(words, folder, rig)
    is_coupled = words.read("coupled")
    noise = words.read("noise")
    words.read("plant")
    given = words.inner("params")
    for key in ("vary", "disturbance"):
        words.inner(key)
    files += tuple(_named_files(words, folder))
    words.table["controller"] = replace(_STANDS_IN, coupled=is_coupled)
    plan, known = resolve(words, folder, None, None if prepared is None else prepared.program)
    if prepared is None and plan.program is not None:
        raise InputError(
            "a case has no path for its reference: give `program` (a part program), or a reference of each axis",
            words.place("reference"),
        )
    plan, plants = plants_of(plan, words)
    if len({axis.axis.unit for axis in plan.axes}) > 1:
        raise InputError("its axes have different units; grade them in cases of their own", words.place("axes"))
    return ControlCase(
        common,
        plan,
        known["period"],
        plants,
        tuple(plan.names),
        is_coupled,
        dict(given.table) if given else {},
        read_disturbance(words.inner("disturbance"), plan.T, plan.samples),
        noise,
        prepared,
        (*files, *([own] if own else [])),
    )


def _program(words: TomlTable, folder: Path, machine: Machine) -> tuple[Prepared | None, tuple[str, ...]]:
    """The part program's motion, planned here; its spindle stands still."""
    name = inside(words, "program", folder)
    if name is None:
        return None, ()
    from rds.nc.check import motion  # most assignments have no part program, and these take long to import
    from rds.nc.run.prepare import planned
    from rds.nc.setup import Setup

    T = words.read("sample_period", machine.sample_period)
    # planned from the text: a compiled form beside it would be written into the assignment
    prepared = planned(motion(folder / name, machine, Setup()), machine, T, folder / name)
    return replace(prepared, program=replace(prepared.program, spindle=None)), (name,)


def _named_files(words: TomlTable, folder: Path) -> list[str]:
    """The files of references and models; InputError for one outside the assignment."""
    tables = [words]
    overrides = words.inner("axis") if isinstance(words.any("axis"), dict) else None
    if overrides is not None:
        tables += [inner for name in overrides.table if (inner := overrides.inner(name)) is not None]
    parts = [part for table in tables for key in ("reference", "model") if (part := table.inner(key))]
    return [file for part in parts if (file := inside(part, "file", folder))]


def plants_of(plan: Plan, words: TomlTable) -> tuple[Plan, tuple[Uncertain, ...]]:
    """The plan with the plants that `plant` names, and what each of them may be by `[case.vary]`."""
    axes = tuple(replace(axis, model=_plant(axis, words)) for axis in plan.axes)
    return replace(plan, axes=axes), tuple(_uncertain(axis, words) for axis in axes)


def _plant(axis: Any, words: TomlTable) -> Any:
    if words.any("plant", "model") == "model":
        return axis.model
    if "model" in words.table:
        raise InputError(
            '[case.model] and plant = "machine" both say what the plant is; give one', words.place("plant")
        )
    own: Axis = axis.axis
    if not own.machine or own.unit == SPINDLE_UNIT:
        raise words.fault("plant", f"will not do: the machine's file says nothing of axis {own.name}'s own motion")
    return library_model("machine-axis", **own.machine)


def _uncertain(axis: Any, words: TomlTable) -> Uncertain:
    numbers = {k: float(v) for k, v in axis.model.params.items() if isinstance(v, int | float)}
    ranges = read_spread(words, numbers)
    if ranges:
        try:
            found = uncertain(axis, ranges)
            for end in (found.spread.low, found.spread.high):  # what is impossible is told now
                found.drawn(end)
        except InputError as error:
            raise InputError(str(error), words.place("vary")) from error
        return found
    return Uncertain(axis.axis.name, Spread((), np.empty(0), {}), axis.model)
