"""One closed loop in the grader's process: the loop, laws and interface of every simulation, a submission as the law.

The submission gets t, the reference and the measured position of one sample, and gives a voltage; the rest stays here.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rds.core.errors import ContractError
from rds.core.types import Controller, Ending, Model, Source
from rds.grading.cases.case import Answers
from rds.modes import SIMULATION, load_mode
from rds.modes.loop.plan import Plan
from rds.modes.process.record import table
from rds.results import Result

SUBMISSION = Source("submission")


@dataclass(frozen=True)
class LoopRun:
    """The samples of a run as a result's table; `fault` says why there are no more, empty if all were taken."""

    result: Result
    fault: str


def asked(answers: Answers, coupled: bool) -> Controller:
    """A controller whose answers are those of a submission whose run has begun."""
    control = answers.control
    return Controller(lambda t, r, y, state, params: (control(t, r, y), state), source=SUBMISSION, coupled=coupled)


def with_parts(plan: Plan, controllers: Sequence[Controller | None], models: Sequence[Model]) -> Plan:
    """The plan with these controllers (None: its own) and models."""
    axes = tuple(
        replace(axis, controller=controller or axis.controller, model=model)
        for axis, controller, model in zip(plan.axes, controllers, models, strict=True)
    )
    return replace(plan, axes=axes)


def run_loop(plan: Plan, meta: dict[str, Any]) -> LoopRun:
    """Run a plan in virtual time. SubmissionError comes through; an axis that runs away ends the run."""
    mode = load_mode(SIMULATION)
    columns, units = plan.columns(mode.followed, mode.simulates_plant)
    recorded = array("d")
    loop = replace(mode.build(plan, None), record=recorded.extend)
    if plan.program is None:
        loop.changes = None  # nobody changes anything while it runs
    fault, ending = "", Ending.FAULT
    try:
        ending = loop.run() or Ending.DONE
    except ContractError as error:  # of the encoder, about a position that is no number
        fault = f"at t = {loop.k * plan.T:.3f} s {str(error).partition(';')[0]}: the loop is not stable"
    if ending is Ending.FOLLOWING_ERROR and loop.changes is not None:
        fault = loop.changes.reason
    values = np.frombuffer(recorded).reshape(-1, len(columns))
    made, of = table(columns, units, values, plan.T)
    about = {"axes": plan.names, "sample_period": plan.T, "mode": mode.name, "ending": str(ending), **meta}
    return LoopRun(Result(made, of, about), fault)
