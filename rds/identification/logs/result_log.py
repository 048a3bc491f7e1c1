"""Our own results as logs: columns, units and what the run knows of itself need no map."""

from __future__ import annotations

import json
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.core.limits import DESCRIPTION, read_limited
from rds.identification.logs.log import Clock, Finding, Gravity, Log
from rds.identification.logs.time_base import time_base
from rds.identification.logs.units import dimension, factor
from rds.results import mat5
from rds.results.header import FORMAT
from rds.results.result import Result

if TYPE_CHECKING:
    from rds.modes.loop.mode import Mode

RECORD = "record.rds"


def is_result(path: Path) -> bool:
    """Whether a folder or file is a saved result of ours, with its description, or the record of a run."""
    if path.is_dir() or path.name == RECORD:
        return True
    ending = path.suffix.lower()
    try:
        if ending == ".csv":
            beside = path.with_suffix(".json")
            about = json.loads(read_limited(beside, DESCRIPTION, "it", "")) if beside.is_file() else None
            return isinstance(about, dict) and about.get("format") == FORMAT
        if ending == ".parquet":
            from pyarrow import parquet

            return b"rds_result" in (parquet.read_schema(path).metadata or {})
        if ending == ".mat":
            return "rds_result" in mat5.names(path)
    except Exception:  # damaged: whoever reads it says how
        return False
    return False


def logs_of_result(result: Result, name: str, source: str, sha256: str) -> list[Log]:
    """A log of each axis that has a position and a voltage. InputError where none has."""
    logs = [_log(result, axis, name, source, sha256) for axis in result.axes if _command(result, axis) is not None]
    if not logs:
        raise InputError(
            "it has no voltage of an axis that was measured (X_voltage, X_measured): there is nothing to identify; "
            "log a run in the mode system-test",
            source,
        )
    return logs


def _command(result: Result, axis: str) -> str | None:
    if f"{axis}_measured" not in result:
        return None
    return next((c for word in ("voltage", "command") if (c := f"{axis}_{word}") in result), None)


def _log(result: Result, axis: str, name: str, source: str, sha256: str) -> Log:
    meta = result.meta
    command = _command(result, axis)
    assert command is not None
    unit = result.units.get(f"{axis}_measured") or "mm"
    extra: dict[str, np.ndarray] = {}
    units = {"time": "s", "command": result.units.get(command) or "V", "position": unit}
    if f"{axis}_reference" in result:
        extra["reference"] = _floats(result, f"{axis}_reference")
        units["reference"] = result.units.get(f"{axis}_reference") or unit
    reach = meta.get("voltage_range")
    mode = _mode(meta)
    is_driven = not meta.get("controller", True) and not extra  # by a voltage over time, in whatever mode
    return Log(
        name=f"{name}:{axis}" if len(result.axes) > 1 else name,
        time=_floats(result, "time"),
        command=_floats(result, command),
        position=_floats(result, f"{axis}_measured"),
        extra=extra,
        units=units,
        resolution=_resolution(meta, axis, unit),
        voltage_range=(-float(reach), float(reach)) if isinstance(reach, int | float) and reach else None,
        closed_loop=None if meta.get("mode") is None else not is_driven and not (mode is not None and mode.open_loop),
        source=source,
        sha256=sha256,
        findings=tuple(_findings(result, command)),
        clocks=(Clock(("command", "position", *extra), "the loop's due times k T, as recorded", _lateness(result)),),
    )


def _mode(meta: dict[str, Any]) -> Mode | None:
    """The mode that a result names; None where it names none, or one that is not known here."""
    from rds.modes import load_mode, mode_names

    return load_mode(meta["mode"]) if meta.get("mode") in mode_names() else None


def _floats(result: Result, column: str) -> np.ndarray:
    return np.asarray(result[column], dtype=np.float64)


def _resolution(meta: dict[str, Any], axis: str, unit: str) -> float | None:
    """From the machine that the result names, where that machine is known here and the encoder was not left out."""
    from rds.machines import load_machine

    if meta.get("quantization") is False and (mode := _mode(meta)) is not None and not mode.real_time:
        return None
    try:
        found = load_machine(str(meta.get("machine"))).axes.get(axis)
    except InputError:
        return None
    if found is None or dimension(found.unit) != dimension(unit):
        return None
    return found.resolution * factor(found.unit, unit)


def _lateness(result: Result) -> float:
    """How far the samples were from their due times, s (RMS); 0 where time was virtual."""
    if "lateness" not in result or not len(result):
        return 0.0
    late = np.asarray(result["lateness"], dtype=np.float64) * 1e-6
    return float(np.sqrt(np.mean(late**2)))


def _findings(result: Result, command: str) -> list[Finding]:
    meta = result.meta
    # a loop that discarded periods held its command over them: its times are used as they are
    found = list(time_base(_floats(result, "time"), inf, "refuse", "keep", "result").findings)
    if meta.get("ending") not in (None, "done"):
        what = f"the run ended early ({meta['ending']}); the log goes on to there"
        found.append(Finding("cut", what, Gravity.WARNING))
    if meta.get("verdict") in ("missed", "void"):
        what = f"timing {meta['verdict']}: some samples were late, so their times are not those of the measurement"
        found.append(Finding("clock", what, Gravity.WARNING))
    if command.endswith("_command"):
        what = f"{command} is what the controller asked for; there is no column of the voltage that acted"
        found.append(Finding("saturation", what, Gravity.WARNING))
    return found
