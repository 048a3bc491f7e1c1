"""A stretch of draws simulated: compiled where the parts can be, else by the ordinary loop. One row for each draw.

This is what goes to another process or computer, so it depends on nothing but its arguments.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rds.core.errors import ContractError, RdsError
from rds.core.types import Ending, Model
from rds.identification.robustness.draws import draws
from rds.identification.robustness.figures import FIGURES, TRACKING, first_counted, tracking_row, voltage_limits
from rds.identification.robustness.margins import law_about_rest, loop_margins
from rds.identification.robustness.uncertain import Uncertain
from rds.models import linear_axis, machine_model
from rds.modes.experiment.compiled import obstacle, pure_law
from rds.modes.loop.plan import AxisPlan, Plan
from rds.modes.process.host import run_plan

COMPILED_MODELS = ("linear-axis", "machine-axis")


@dataclass(frozen=True)
class Task:
    """What is studied: the plan of one simulation, what its axes may be, and the seed of the draws."""

    plan: Plan
    axes: tuple[Uncertain, ...]
    seed: int
    periods: dict[str, float | None]

    def simulate(self, stretch: tuple[int, int]) -> tuple[np.ndarray, dict[int, str]]:
        """Draws number `first` to before `end`: figures (draws, axes, FIGURES), and why a draw has none."""
        first, end = stretch
        models = [
            [axis.drawn(row) for row in draws(axis.spread, self.seed + number, first, end)]
            for number, axis in enumerate(self.axes)
        ]
        rows, reasons = self.figures_of(models)
        return rows, {first + k: reason for k, reason in reasons.items()}

    def figures_of(self, models: list[list[Model]]) -> tuple[np.ndarray, dict[int, str]]:
        """The figures of runs with these models (a list for each axis, a model for each run)."""
        rows = np.full((len(models[0]), len(self.axes), len(FIGURES)), np.nan)
        reasons: dict[int, str] = {}
        if not_compiled(self.plan, [column[0] for column in models]) is None:
            for number, column in enumerate(models):
                rows[:, number, : len(TRACKING)] = _compiled(self, number, column)
        else:
            for k in range(len(rows)):
                found = self.once([column[k] for column in models])
                if isinstance(found, str):
                    reasons[k] = found
                else:
                    rows[k, :, : len(TRACKING)] = found
        for number, column in enumerate(models):
            law = law_about_rest(self.plan.axes[number].controller)
            if law is not None:
                rows[:, number, len(TRACKING) :] = loop_margins(law, column, self.plan.T)
        return rows, reasons

    def once(self, models: list[Model]) -> np.ndarray | str:
        """The tracking figures (axes, TRACKING) of one run by the ordinary loop, or why there are none."""
        axes = tuple(replace(axis, model=model) for axis, model in zip(self.plan.axes, models, strict=True))
        try:
            rows = run_plan(replace(self.plan, axes=axes), None)
        except ContractError as error:
            if "became" in str(error):  # the encoder's words for a position that is no finite number
                return np.full((len(axes), len(TRACKING)), np.inf)
            return str(error)
        except RdsError as error:
            return str(error)
        if rows.ending is not Ending.DONE:
            return rows.reason
        column = dict(zip(rows.columns, rows.values.T, strict=True))
        limits, T = voltage_limits(self.plan), self.plan.T
        return np.array(
            [
                tracking_row(
                    column[f"{name}_reference"] - column[f"{name}_measured"],
                    column[f"{name}_command"],
                    first_counted(self.periods.get(name), T, self.plan.samples),
                    limits,
                    T,
                )
                for name in self.plan.names
            ]
        )


def not_compiled(plan: Plan, models: list[Model]) -> str | None:
    """Why the loops cannot be compiled, in a sentence; None if they can."""
    for axis, model in zip(plan.axes, models, strict=True):
        if model.source.name not in COMPILED_MODELS or model.source.path is not None:
            return f"axis {axis.axis.name}: only {' and '.join(COMPILED_MODELS)} can be compiled"
    plain = linear_axis.make(tau=1.0, K=1.0)  # stands for all models that compile
    return obstacle(replace(plan, axes=tuple(replace(axis, model=plain) for axis in plan.axes)))


def _compiled(task: Task, number: int, models: list[Model]) -> np.ndarray:
    from rds.identification.robustness.kernels import sweep

    plan = task.plan
    axis = plan.axes[number]
    law, reference, controller = pure_law(axis), axis.reference, axis.controller
    assert law is not None and reference is not None and controller is not None
    rows = np.empty((len(models), len(TRACKING)))
    for name in COMPILED_MODELS:
        chosen = [k for k, model in enumerate(models) if model.source.name == name]
        if not chosen:
            continue
        constants, wait = _constants(name, [models[k] for k in chosen], plan.T)
        part = np.empty((len(chosen), len(TRACKING)))
        sweep(law, name)(
            *(np.asarray(values, float) for values in (reference.position, reference.velocity, reference.acceleration)),
            tuple(controller.params["coefficients"]),
            tuple(float(value) for value in controller.initial_state),
            constants,
            wait,
            _start(axis),
            voltage_limits(plan),
            axis.axis.resolution if plan.quantization else 0.0,
            first_counted(task.periods.get(axis.axis.name), plan.T, plan.samples),
            plan.T,
            part,
        )
        rows[chosen] = part
    return rows


def _start(axis: AxisPlan) -> tuple[float, float, float]:
    values = [float(value) for value in axis.model.initial_state]
    return values[0], values[1], values[2] if len(values) > 2 else 0.0


def _constants(name: str, models: list[Model], T: float) -> tuple[np.ndarray, np.ndarray]:
    module: Any = linear_axis if name == "linear-axis" else machine_model
    constants = np.array([module.coefficients(model.params, T) for model in models], float)
    delays = [model.params.get("delay", 0.0) for model in models]
    return constants, np.array([machine_model.split_delay(delay, T)[0] for delay in delays], np.int64)
