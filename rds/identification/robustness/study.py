"""A study: an experiment's closed loop run with parameters that are drawn, and what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rds.core.errors import InputError
from rds.core.parallel import Scheduler, processors, spread
from rds.core.progress import Progress
from rds.core.types import Model
from rds.identification.robustness.draws import LEVEL, draws
from rds.identification.robustness.figures import FIGURES
from rds.identification.robustness.loops import Task, not_compiled
from rds.identification.robustness.uncertain import Ranges, read_ranges, uncertain
from rds.modes import SIMULATION
from rds.modes.experiment import Experiment

MOST_RUNS = 10_000_000
_STRETCHES = 16  # for each processor: progress, and an even load to the end
_LONGEST = 500  # draws in a stretch


@dataclass(frozen=True)
class Study:
    """Figures of every draw. `figures` is (draws, axes, FIGURES), `drawn` one array (draws, parameters) for each axis.

    The nominal run is that of the estimates themselves. NaN: not known; an infinite error: the loop diverged.
    """

    task: Task
    drawn: tuple[np.ndarray, ...]
    figures: np.ndarray
    nominal: np.ndarray  # (axes, FIGURES)
    reasons: Mapping[int, str]  # why a draw has no figures
    level: float
    notes: tuple[str, ...]
    seconds: float

    def __repr__(self) -> str:
        unstable = sum(int(self.unstable(number).sum()) for number in range(len(self.axes)))
        seconds = self.task.plan.samples * self.task.plan.T
        runs = f"{len(self.figures)} runs of {seconds:g} s, seed {self.task.seed}"
        return f"<Study of {', '.join(self.axes)}: {runs}, {unstable} unstable, {len(self.reasons)} not run>"

    def _repr_html_(self) -> str:
        from rds.identification.robustness.report import fragment

        return fragment(self)

    @property
    def axes(self) -> list[str]:
        """The axes' names."""
        return [axis.name for axis in self.task.axes]

    def figure(self, axis: int, name: str) -> np.ndarray:
        """One figure of every draw."""
        found: np.ndarray = self.figures[:, axis, list(FIGURES).index(name)]
        return found

    def unstable(self, axis: int) -> np.ndarray:
        """Which draws diverged, or have a pole of the linearized loop on or outside the unit circle."""
        return np.isinf(self.figure(axis, "max_error")) | (self.figure(axis, "pole_radius") >= 1.0)

    @property
    def failed(self) -> bool:
        """Whether any draw is unstable or could not be run."""
        return bool(self.reasons) or any(self.unstable(number).any() for number in range(len(self.task.axes)))

    def model(self, draw: int, axis: int = 0) -> Model:
        """The model of one draw, to run again by itself: `rds.Experiment(model=study.model(17), ...)`."""
        return self.task.axes[axis].drawn(self.drawn[axis][draw])


def study(
    experiment: Experiment | str | Path,
    runs: int = 1000,
    *,
    seed: int = 0,
    model: str | Path | None = None,
    ranges: Ranges | str | Path | None = None,
    level: float = LEVEL,
    jobs: int | None = None,
    scheduler: str | Scheduler | None = None,
    progress: Progress | None = None,
    announce: Callable[[str], None] | None = None,
) -> Study:
    """Run the experiment's simulation `runs` times, each with parameters drawn from what its axes may be.

    They are drawn from the confidence region (of `level`) of the model file that the experiment, or `model`, names, or
    from `ranges` {axis: {parameter: (lowest, highest)}}; see `draws`. The controller is made once, for the estimates.
    Library controllers on library models run compiled; others in Python on `jobs` processes, and `announce` is told
    beforehand about how long that takes. With a dask `scheduler` they run there. The figures are the same in any case.
    Raises InputError for an experiment that has no controller or no spread, and for numbers that will not do.
    """
    for name, value, low, high in (("runs", runs, 1, MOST_RUNS), ("seed", seed, 0, 2**63)):
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise InputError(f"{name} = {value!r} must be a whole number from {low} to {high}")
    if not 0.0 < level < 1.0:
        raise InputError(f"level = {level!r} must be between 0 and 1, such as 0.95")
    if not isinstance(experiment, Experiment):
        experiment = Experiment.from_toml(experiment)
    if model is not None:
        experiment = experiment.with_model({"file": str(Path(model).resolve())})
    task = _task(experiment, seed, ranges, level)
    begun = time.perf_counter()
    obstacle = not_compiled(task.plan, [axis.base for axis in task.axes])
    nominal = _nominal(task)
    notes = _notes(task, obstacle)
    local = obstacle is None and scheduler is None and jobs is None
    if announce and obstacle is not None and scheduler is None:
        announce(_estimate(task, runs, jobs or processors(), obstacle))
    figures, reasons = _gathered(task, runs, _threads if local else _spread(jobs, scheduler), progress)
    drawn = tuple(draws(axis.spread, seed + number, 0, runs) for number, axis in enumerate(task.axes))
    return Study(task, drawn, figures, nominal, reasons, level, notes, time.perf_counter() - begun)


def _task(experiment: Experiment, seed: int, ranges: Ranges | str | Path | None, level: float) -> Task:
    plan = experiment.plan(SIMULATION)
    if not plan.controlled:
        raise InputError("it has no controller: robustness is that of a closed loop; give [reference] and [controller]")
    given = read_ranges(ranges) if isinstance(ranges, str | Path) else dict(ranges or {})
    for name in given:
        if name not in plan.names:
            raise InputError(f"ranges are given for axis {name!r}, which does not run; it runs {', '.join(plan.names)}")
    axes = tuple(uncertain(axis, given.get(axis.axis.name), level) for axis in plan.axes)
    return Task(plan, axes, seed, experiment.periods)


def _nominal(task: Task) -> np.ndarray:
    """The figures of the estimates themselves, as those of a draw."""
    found, reasons = task.figures_of([[axis.drawn(axis.spread.values)] for axis in task.axes])
    if reasons:
        raise InputError(f"with the estimates themselves, the experiment does not run: {reasons[0]}")
    nominal: np.ndarray = found[0]
    return nominal


def _estimate(task: Task, runs: int, jobs: int, obstacle: str) -> str:
    begun = time.perf_counter()
    task.once([axis.drawn(axis.spread.values) for axis in task.axes])
    seconds = (time.perf_counter() - begun) * runs / min(jobs, runs)
    took = f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"
    where = f"{min(jobs, runs)} process{'es' if min(jobs, runs) > 1 else ''}"
    return f"runs in Python, not compiled ({obstacle}): about {took} for {runs} runs on {where}"


def _notes(task: Task, obstacle: str | None) -> tuple[str, ...]:
    notes = [] if obstacle is None else [f"not compiled: {obstacle}"]
    notes += [f"axis {axis.name}: {sentence}" for axis in task.axes for sentence in axis.doubts]
    fixed = {axis.name: [name for name in axis.spread.names if name not in axis.spread.varied] for axis in task.axes}
    notes += [f"axis {axis}: {', '.join(names)} the same in every draw" for axis, names in fixed.items() if names]
    return tuple(notes)


Run = Callable[[Task, list[tuple[int, int]]], Iterator[tuple[tuple[int, int], Any]]]


def _gathered(task: Task, runs: int, run: Run, progress: Progress | None) -> tuple[np.ndarray, dict[int, str]]:
    length = max(1, min(_LONGEST, runs // (processors() * _STRETCHES)))
    stretches = [(first, min(first + length, runs)) for first in range(0, runs, length)]
    figures = np.full((runs, len(task.axes), len(FIGURES)), np.nan)
    reasons: dict[int, str] = {}
    done = 0
    for (first, end), found in run(task, stretches):
        if isinstance(found, str):
            reasons |= dict.fromkeys(range(first, end), found)
        else:
            figures[first:end] = found[0]
            reasons |= found[1]
        done += end - first
        if progress:
            progress(done, runs)
    return figures, reasons


def _threads(task: Task, stretches: list[tuple[int, int]]) -> Iterator[tuple[tuple[int, int], Any]]:
    """Compiled loops let go of the interpreter: threads of this process will do."""
    with ThreadPoolExecutor(processors()) as pool:
        try:
            yield from zip(stretches, pool.map(task.simulate, stretches), strict=True)
        finally:
            pool.shutdown(cancel_futures=True)


def _spread(jobs: int | None, scheduler: str | Scheduler | None) -> Run:
    def run(task: Task, stretches: list[tuple[int, int]]) -> Iterator[tuple[tuple[int, int], Any]]:
        for outcome in spread(task.simulate, stretches, jobs=jobs, scheduler=scheduler):
            yield stretches[outcome.index], outcome.value if outcome.ok else outcome.reason

    return run
