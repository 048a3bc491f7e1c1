"""A part program or an experiment that was loaded: what it is, and how far its run is."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.types import Ending
from rds.modes.experiment.experiment import Experiment
from rds.modes.experiment.run import Run
from rds.nc.run.run import PartProgram, ProgramRun

LOADED, QUEUED, STARTING, RUNNING, OVER = "loaded", "queued", "starting", "running", "over"
_BEGIN = 30.0  # s in which a run is under way, or something is wrong


class Job:
    """One loaded file; `run` is its run once it was started. `state` is loaded, queued, starting, running or over."""

    def __init__(self, number: int, name: str, experiment: Experiment, mode: str):
        self.number, self.name, self.experiment, self.mode = number, name, experiment, mode
        self.state = LOADED
        self.run: Run | None = None
        self.out: Path | None = None
        self.error: str | None = None

    @property
    def kind(self) -> str:
        """What was loaded."""
        return "part program" if isinstance(self.experiment, PartProgram) else "experiment"

    def about(self) -> dict[str, Any]:
        """What is known before it runs."""
        plan = self.experiment.plan(self.mode)
        told: dict[str, Any] = {
            "kind": self.kind,
            "mode": self.mode,
            "axes": list(plan.names),
            "seconds": plan.samples * plan.T,
        }
        if isinstance(self.experiment, PartProgram):
            told["notes"] = list(self.experiment.prepared.notes)
        return told

    def active(self) -> Run:
        """Its run, whose live values can be set. InputError where it does not run."""
        if self.state not in (STARTING, RUNNING) or self.run is None or not self.run.ready(_BEGIN) or self.run.done:
            remedy = {LOADED: 'begin it with "do": "run"', OVER: "load its file again"}.get(self.state, "wait")
            raise InputError(f"job {self.number} does not run: it is {self.state}; {remedy}")
        return self.run

    def program(self) -> ProgramRun:
        """The run of a part program. InputError for an experiment, which can only be stopped."""
        run = self.active()
        if not isinstance(run, ProgramRun):
            raise InputError(f"job {self.number} is an experiment, which has no path to hold on; `stop` ends it")
        return run

    def status(self) -> dict[str, Any]:
        """Where it is: state, samples, positions in the units of the axes, the ending of a run that is over."""
        told: dict[str, Any] = {"job": self.number, "file": self.name, "kind": self.kind, "mode": self.mode}
        told["state"] = self.state
        run = self.run
        if run is None:
            return told if self.error is None else told | {"error": self.error}
        told["taken"], told["samples"] = run.progress
        if self.error is not None:
            told["error"] = self.error
        elif told["state"] == OVER:
            meta = run.wait().meta
            told |= {"ending": str(meta.get("ending", Ending.DONE)), "verdict": run.wait().verdict}
            if meta.get("ending_reason"):
                told["reason"] = str(meta["ending_reason"])
        told |= _position(run)
        return told


def _position(run: Run) -> dict[str, Any]:
    """The last sample."""
    if isinstance(run, ProgramRun) and not run.done:
        now = run.status()
        if now is None:
            return {}
        return {
            "time": now.time,
            "line": now.line,
            "program": now.state.name.lower(),
            "override": now.rate,
            "feed": now.feed,
            "share": now.share,
            "measured": _numbers(now.measured),
            "reference": _numbers(now.reference),
        }
    columns = run.columns
    if not columns:
        return {}
    rows = run.read(max(run.progress[0] - 1, 0))[1]
    if not len(rows):
        return {}
    last = dict(zip(columns, rows[-1].tolist(), strict=True))
    measured = {name: last[f"{name}_measured"] for name in run.plan.names if f"{name}_measured" in last}
    return {"time": last["sample"] * run.plan.T, "measured": _numbers(measured)}


def _numbers(values: dict[str, float]) -> dict[str, float | None]:
    """JSON has no word for what is not a finite number."""
    return {name: value if isfinite(value) else None for name, value in values.items()}
