"""A model's case: hidden data, from a log or from a plant of the student's own, and the submission's free run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.grading.cases.case import COUNTS, CaseRun, Submitted
from rds.grading.cases.control import plants_of
from rds.grading.cases.loop import run_loop
from rds.grading.cases.plant import disturbed, drawn_model, noise_of
from rds.grading.cases.words import CommonFields, as_own_file, inside, read_common
from rds.grading.grade import Status
from rds.grading.sandbox.errors import SubmissionError
from rds.identification.robustness.uncertain import Uncertain
from rds.modes.experiment.resolve import resolve
from rds.modes.loop.plan import Plan
from rds.results import Result

_LARGEST = 1e100  # of an output, in the axis's unit: beyond it sums of squares are no numbers
_NOT_HERE = ("mode", "controller", "bus", "network", "timing", "compiled", "reference")


@dataclass(frozen=True)
class ModelCase:
    """Voltages and what an axis answered; the submission gets the voltages one by one, and never the answers."""

    common: CommonFields
    params: dict[str, Any]
    unit: str
    files: tuple[str, ...]
    data: Result | None = None  # of a log
    plan: Plan | None = None  # of a signal
    plants: tuple[Uncertain, ...] = ()
    noise: float = 0.0

    name = property(lambda self: self.common.name)
    title = property(lambda self: self.common.title)
    is_visible = property(lambda self: self.common.is_visible)
    runs = property(lambda self: self.common.runs)
    can_be_linearized = False

    @property
    def is_drawn(self) -> bool:
        """Whether a plant or the noise is drawn for each student."""
        return bool(self.noise) or any(plant.spread.names for plant in self.plants)

    def run(self, submitted: Submitted, seed: int, number: int, needs: Iterable[str] = ()) -> CaseRun:
        """The free run of the model on run `number`'s data, from its own initial state."""
        data = self.data if self.data is not None else self._measured(seed, number)
        axis = data.axes[0]
        subject = submitted.subject()
        modelled = np.array(free_run(subject, data[f"{axis}_voltage"].tolist(), self.params, data.sample_period))
        if np.abs(modelled).max() > _LARGEST:
            raise SubmissionError(Status.BROKE_CONTRACT, f"its output went beyond {_LARGEST:g} {self.unit}")
        # where an axis stands at first is not the model's to know
        modelled += data[f"{axis}_measured"][0] - modelled[0]
        columns = dict(data.columns) | {f"{axis}_modelled": modelled}
        units = dict(data.units) | {f"{axis}_modelled": self.unit}
        counts = subject.counts if COUNTS in needs else None
        return CaseRun(self.name, number, Result(columns, units, data.meta), counts=counts)

    def _measured(self, seed: int, number: int) -> Result:
        plan = self.plan
        assert plan is not None
        noise = noise_of(self.noise, plan.samples, seed, self.name, number)
        model = disturbed(drawn_model(self.plants[0], seed, number), None, noise)
        done = run_loop(replace(plan, axes=(replace(plan.axes[0], model=model),)), {})
        if done.fault:
            raise InputError(f"case {self.name}: {done.fault}; mend the case's plant")
        return done.result


def free_run(subject: Any, voltages: Sequence[float], params: dict[str, Any], T: float) -> list[float]:
    """The model's output at each sample, before that sample's voltage acts."""
    first = subject.begin_model(params, T)
    return [first, *map(subject.advance, voltages[:-1])]


def read(words: TomlTable, folder: Path, machine: str) -> ModelCase:
    """A table `[[case]]` of a model's assignment: with `log`, or with `signal` and a plant."""
    words = as_own_file(words, {"machine": machine})
    common = read_common(words)
    for key in _NOT_HERE:
        if key in words.table:
            raise InputError(f"{key} has no place in a model's case; it has log, or signal", words.place(key))
    given = words.inner("params")
    params = dict(given.table) if given else {}
    log = inside(words, "log", folder)
    if log is not None:
        return _of_log(words, common, params, folder, log)
    noise = words.read("noise")
    words.read("plant")
    words.inner("vary")
    if "signal" not in words.table:
        raise InputError("a model's case needs `log` (a file of data) or [case.signal] (voltages)", words.place())
    files = [
        file for key in ("signal", "model") if (part := words.inner(key)) and (file := inside(part, "file", folder))
    ]
    plan, _ = resolve(words, folder)
    if len(plan.axes) != 1:
        raise InputError("a model's case has one axis", words.place("axes"))
    plan, plants = plants_of(plan, words)
    unit = plan.axes[0].axis.unit
    return ModelCase(common, params, unit, tuple(files), plan=plan, plants=plants, noise=noise)


def _of_log(words: TomlTable, common: CommonFields, params: dict[str, Any], folder: Path, log: str) -> ModelCase:
    from rds.identification.logs.read_log import read_log

    mapping, axis = inside(words, "map", folder), words.read("axis")
    words.any("machine")
    words.done()
    if common.runs != 1:
        raise words.fault("runs", "will not do with `log`: there is nothing to draw; remove it")
    logs = read_log(folder / log, None if mapping is None else folder / mapping)
    chosen = [each for each in logs if axis is None or each.name == axis]
    if len(chosen) != 1:
        names = ", ".join(each.name for each in logs)
        raise words.fault("log", f"holds {len(logs)} logs ({names}); name one of them with `axis`, or cut the file")
    data, T = chosen[0], chosen[0].sample_period
    unit = data.units.get("position", "mm")
    if data.units.get("command", "V") != "V":
        raise words.fault("log", "does not hold a voltage in V; a model gets volts")
    columns = {"time": np.arange(len(data)) * T, "X_measured": data.position, "X_voltage": data.command}
    result = Result(columns, {"X_measured": unit}, {"axes": ["X"], "sample_period": T})
    return ModelCase(common, params, unit, (log, *([mapping] if mapping else [])), data=result)
