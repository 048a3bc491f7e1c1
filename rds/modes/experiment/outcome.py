"""From the rows that a loop recorded to the result that a user sees."""

from __future__ import annotations

import datetime
import io
import platform
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout, suppress
from dataclasses import replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from math import isclose
from threading import Lock
from typing import Any

import numpy as np

from rds.core.installed import version as own_version
from rds.core.types import Ending, Model, Source
from rds.core.values import shown
from rds.machines.converter import limits
from rds.modes import SIMULATION, load_mode
from rds.modes.loop.commands import Command
from rds.modes.loop.plan import Plan
from rds.modes.loop.program import InterpolatedProgram
from rds.modes.loop.stopwatch import TIMING_COLUMNS
from rds.modes.process.environment import sentence
from rds.modes.process.host import FailedSimulation, Rows, run_plan
from rds.modes.process.record import table
from rds.modes.process.replay import as_recorded
from rds.modes.process.second_look import own_times
from rds.modes.process.timing import Timing, judge, summary
from rds.results import Result

_CLOSE = 0.006  # mm: as `rds check` has it
_OFTEN = 20.0  # % of the samples: from here on a voltage at its limit is told
_QUIET = Lock()  # what threads redirect at once, one would restore to a file that another has closed
_NEARLY_ALL = 0.9  # of the samples: the law of an axis that runs away by its sign
_LONGEST = 1024  # bits of an int that is kept as a number: beyond some thousand digits Python does not print it


def outcome(plan: Plan, rows: Rows, known: dict[str, Any]) -> Result:
    """The result of a run: its table, and in `meta` all that was known of it."""
    mode = load_mode(plan.mode)
    columns, units = table(rows.columns, rows.units, rows.values, plan.T)
    if plan.program is None:
        for told in (columns, units):
            told.pop("interpolate", None)  # nothing was interpolated
    sample = rows.values[:, 0].astype(np.int64)
    meta = _description(plan, rows) | known
    if mode.followed and plan.controlled and plan.repeatable:
        try:
            columns |= _simulated(plan, rows, sample)
        except FailedSimulation as error:  # what the machine did is kept
            meta["notes"].append(f"the same run simulated has no response to compare with: {error}")
    meta["notes"] += (
        _short_of_its_end(plan, rows, columns)
        + _of_another_period(plan)
        + (_beyond_travel(plan, columns) or _at_the_limit(plan, columns))
        + _concluded(plan, columns)
    )
    if mode.real_time:
        meta |= _judged(plan, rows, sample)
        if note := bus_note(meta["drivers"], meta["bus"]):
            meta["notes"].append(note)
    return Result(columns, units, meta)


def _of_another_period(plan: Plan) -> list[str]:
    """A sentence for each file of a law that was made for another sample period."""
    laws = {law.source.name: law for part in plan.axes if (law := part.controller) is not None}
    return [
        f"{name} says that it is made for a sample period of {law.sample_period:g} s, and the run has {plan.T:g} s; "
        "design it for that, or run it with its own"
        for name, law in laws.items()
        if law.sample_period is not None and not isclose(law.sample_period, plan.T)
    ]


def _short_of_its_end(plan: Plan, rows: Rows, columns: dict[str, np.ndarray]) -> list[str]:
    """A sentence for an interpolator whose last row is not the end of the path."""
    program = plan.program
    if not isinstance(program, InterpolatedProgram) or rows.ending is not Ending.DONE:
        return []
    end = program.path[-1]["end"][["XYZABC".index(name) for name in program.axes]]
    last = np.array([columns[f"{name}_reference"][-1] for name in program.axes])
    away = float(np.linalg.norm(last - end))
    if away <= max(_CLOSE, program.blu * len(program.axes)):
        return []
    return [
        f"the last row of the interpolator {program.about['interpolator']} is {away:.3g} mm from the end of the path; "
        "let the last row of each segment be its end"
    ]


def _beyond_travel(plan: Plan, columns: dict[str, np.ndarray]) -> list[str]:
    """A sentence for each axis that was beyond its travel, which an unstable law or model does first of all.

    Of a spindle it is a speed, and one that overshoots is no fault: it is told from ten times its range on.
    """
    said = []
    for part in plan.axes:
        axis = part.axis
        measured = columns.get(f"{axis.name}_measured", np.empty(0))
        low, high = axis.travel
        turns = axis.unit == "rev/min"
        beyond = 10.0 if turns else 1.0
        if not ((measured < beyond * low) | (measured > beyond * high)).any():
            continue
        there = f"{np.nanmin(measured):.4g} to {np.nanmax(measured):.4g} {axis.unit}"
        cause = "the signal" if part.signal is not None else "the sign and the gains of the law"
        if load_mode(plan.mode).simulates_plant and part.model.source.text is not None:  # a student's own
            cause += ", and at whether your model is stable (`rds check`)"
        said.append(
            f"{axis.name} was at {there}, beyond its {'range' if turns else 'travel'} of {low:g} to {high:g} "
            f"{axis.unit}; look at {cause}"
        )
    return said


def _at_the_limit(plan: Plan, columns: dict[str, np.ndarray]) -> list[str]:
    """A sentence for each law whose voltage the converter limited for a good part of the run: nothing else tells it."""
    board, said = plan.machine.converter, []
    low, high, _ = limits(board.range, board.bits, quantization=plan.quantization)
    for part in plan.axes:
        voltage = columns.get(part.acting, np.empty(0))
        if not plan.saturation or part.signal is not None or part.command is not Command.VOLTAGE or not len(voltage):
            continue
        if part.controller is not None and part.controller.conclude is not None:
            continue  # a relay switches between limits, and says itself what came of it
        share = 100.0 * float(np.mean((voltage <= low) | (voltage >= high)))
        name, reference = part.axis.name, columns.get(f"{part.axis.name}_reference")
        if share < _OFTEN:
            continue
        if reference is not None and _drives_away(voltage, reference - columns[f"{name}_measured"]):
            said.append(
                f"{name}: the law drives the axis off, with the voltage at ±{board.range:g} V in {share:.0f} % of the "
                "samples; turn its sign: the error is the reference minus the measurement"
            )
            continue
        said.append(
            f"{name}: the converter limited the voltage to ±{board.range:g} V in {share:.0f} % of the "
            "samples, where the law has no effect; lower its gains, or ask for a slower or smaller motion"
        )
    return said


def _drives_away(voltage: np.ndarray, error: np.ndarray) -> bool:
    """Whether nearly all samples have a voltage against the error, and the error is large to the end: a wrong sign."""
    return bool(np.mean(voltage * error < 0.0) > _NEARLY_ALL and abs(error[-1]) > 0.5 * np.abs(error).max())


def _concluded(plan: Plan, columns: dict[str, np.ndarray]) -> list[str]:
    """What the law of each axis says about its run, from the signals that it had recorded."""
    said = []
    for part in plan.axes:
        law, name = part.controller, part.axis.name
        if law is not None and law.conclude is not None and len(next(iter(columns.values()))):
            signals = {signal: columns[f"{name}_{signal}"] for signal in law.signals}
            said.append(law.conclude(name, part.axis.unit, signals, law.params))
    return said


class _Nowhere(io.RawIOBase):
    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        return len(data)


def _simulated(plan: Plan, rows: Rows, sample: np.ndarray) -> dict[str, np.ndarray]:
    """Each axis's response in a closed loop of its own: the same plan, simulated, for as long as the run lasted."""
    same = replace(as_recorded(plan, rows).unwatched(), mode=SIMULATION, samples=int(sample[-1]) + 1)
    nowhere = io.TextIOWrapper(io.BufferedWriter(_Nowhere()), "utf-8", "replace")  # laws may write to its buffer, too
    with _QUIET, redirect_stdout(nowhere):
        simulated = run_plan(same, None)  # its prints would pass for the run's own, which are in `target.log`
    of = dict(zip(simulated.columns, simulated.values.T, strict=True))
    return {f"{name}_simulated": of[f"{name}_measured"][sample] for name in plan.names}


def _judged(plan: Plan, rows: Rows, sample: np.ndarray) -> dict[str, Any]:
    """The timing summary and the verdict, with the environment that they were measured in."""
    environment, drivers = rows.report.get("environment", {}), rows.report.get("drivers", {})
    recorded = dict(zip(rows.columns, rows.values.T, strict=True))
    timing = Timing(sample, *(recorded[name] for name in TIMING_COLUMNS))
    period = round(plan.T * 1e9)
    whole = rows.ending is Ending.DONE and plan.program is None
    passed = plan.samples if whole else int(sample[-1]) + 1
    judgement = judge(
        timing,
        period,
        limit=plan.late_limit,
        discarded=passed - len(sample),
        stalls=environment.get("rehearsal", {}).get("stalls", 0),
        threads=environment.get("threads", 0),
        missing=drivers.get("missing", 0),
        silent=drivers.get("silent", 0),
        again=partial(own_times, plan, rows),
        environment=environment,
    )
    return {
        "verdict": str(judgement.verdict),
        "verdict_reason": judgement.reason,
        "verdict_evidence": judgement.evidence,
        "timing": summary(timing, period)
        | {"discarded": judgement.discarded, "late_without_system": judgement.late_without_system},
        "environment": environment | {"sentence": sentence(environment)} if environment else {},
        "drivers": drivers,
        "bus": rows.report.get("bus", {}),
    }


def _description(plan: Plan, rows: Rows) -> dict[str, Any]:
    board = plan.machine.converter
    return {
        "mode": plan.mode,
        "machine": plan.machine.name,
        "axes": plan.names,
        "sample_period": plan.T,
        "duration": plan.samples * plan.T,
        "voltage_range": board.range,
        "saturation": plan.saturation,
        "quantization": plan.quantization,
        "controller": {
            p.axis.name: _part(p.controller.source, p.controller.params) for p in plan.axes if p.controller is not None
        },
        "model": {p.axis.name: _model(p.model) for p in plan.axes},
        "ending": str(rows.ending),
        "ending_reason": rows.reason,
        "changes": [list(change) for change in rows.changes],
        "notes": [*plan.notes, *rows.notes],
        "started": datetime.datetime.now().astimezone().isoformat(timespec="seconds"),
        "versions": _versions(),
    }


def _part(source: Source, params: Any) -> dict[str, Any]:
    plain = {key: _plain(value) for key, value in dict(params).items()}
    return {"name": source.name, "path": source.path, "sha256": source.sha256, "source": source.text, "params": plain}


def _model(model: Model) -> dict[str, Any]:
    part, file = _part(model.source, model.params), model.fitted
    return part | ({"fitted": {"path": file.path, "sha256": file.sha256, "source": file.text}} if file else {})


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    plain = isinstance(value, bool | float | str | None) or (isinstance(value, int) and value.bit_length() <= _LONGEST)
    return value if plain else shown(value, 200)


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version(), "rds": own_version(), "numpy": np.__version__}
    for name in ("python-can", "numba"):
        if name.replace("python-", "") in sys.modules:
            with suppress(PackageNotFoundError):
                versions[name] = version(name)
    return versions


def bus_note(drivers: Mapping[str, Any], bus: Mapping[str, Any]) -> str | None:
    """From the drivers' counters and the statistics of the built-in bus (either may be empty); None: all went well."""
    parts = []
    if missing := drivers.get("missing", 0):
        late = min(drivers.get("late", 0), missing)
        came = f", {late} of them came later" if late else ""
        of = "the position before stood in for " + ("it" if missing == 1 else "each")
        parts.append(f"{_some(missing, 'answer')} of modules did not come within the period{came} ({of})")
    if damaged := drivers.get("damaged", 0):
        parts.append(f"{_some(damaged, 'answer')} came damaged, by noise on the line: see to its cable and shield")
    if lost := drivers.get("lost_ticks", 0):
        parts.append(f"modules missed {_some(lost, 'command')}")
    if cut := drivers.get("cut", 0):
        parts.append(f"zero volts for {_some(cut, 'period')}, because a module was silent")
    if emergencies := drivers.get("emergencies", 0):
        parts.append(_some(emergencies, "emergency message"))
    if errors := bus.get("error_frames", 0):
        parts.append(f"{_some(errors, 'error frame')}, after which the frames were sent again")
    if struck := bus.get("struck", 0):
        parts.append(f"{_some(struck, 'frame')} struck by injected faults")
    return f"on the bus: {'; '.join(parts)}" if parts else None


def _some(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"
