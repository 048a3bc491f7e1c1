"""The check of a student's file in a process of its own, which may hang, crash or flood without harm."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rds.checks import clauses
from rds.checks.child import ChildEnd, run_child
from rds.checks.report import CheckReport, Fault, FileReport, read_faults, read_report
from rds.core.errors import ContractError, InputError
from rds.core.shared_quantities import SAMPLE_PERIOD

TIME_LIMIT = 30.0  # s: an ordinary file takes one or two, and as long again to import what it needs
MEMORY_LIMIT = 4 << 30  # bytes of address space: an interpreter with scipy and numba has less than half of it
_START_UP = 15.0  # s that a loaded machine may take before the worker's own time limit runs
_FUNCTION = {"controller": "control()", "model": "the model", "interpolator": "interpolate()", "file": "the file"}
_LARGEST = 1 << 20  # bytes of result
_OTHER_FILES = {  # by their endings
    **dict.fromkeys((".ngc", ".nc", ".tap", ".gcode"), "`rds nc check` looks at a part program"),
    **dict.fromkeys((".csv", ".tsv", ".mat", ".parquet", ".mf4"), "`rds data describe` looks at a log"),
    **dict.fromkeys((".dxf", ".svg"), "`rds nc make` looks at a drawing"),
    ".ncc": "`rds machine new` reads a configuration script",
}
# Many threads of a matrix library need more address space than a student's file, and no time is gained by them.
_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "MPLBACKEND": "Agg",
    "PYTHONUTF8": "1",
}


def check_file(
    path: str | Path,
    sample_period: float = 0.001,
    *,
    coupled: bool = False,
    axes: int = 2,
    time_limit: float = TIME_LIMIT,
    memory_limit: int = MEMORY_LIMIT,
    pulse: Callable[[], None] = lambda: None,
) -> FileReport:
    """Check every interface that the file at `path` fills, for a loop of `sample_period` s.

    The file runs in a fresh interpreter that has `time_limit` s and `memory_limit` bytes. Code that hangs, crashes or
    exits is a fault in the report; what it prints is counted in a warning. A `coupled` controller gets `axes` axes.
    `pulse()` is called ten times a second meanwhile: what it raises ends the check.
    This protects from accidents, not from attacks. Raises InputError, with file and line, for a file that is
    missing, is of another kind, cannot be read or run, or fills no interface.
    """
    SAMPLE_PERIOD.check(sample_period, "sample_period")
    file = Path(path).absolute()
    if other := _OTHER_FILES.get(file.suffix.lower()):  # it would be run as Python
        raise InputError(f"it is no Python file; {other}", str(path))
    with tempfile.TemporaryDirectory(prefix="rds-check-") as folder:
        result, trace = Path(folder, "result"), Path(folder, "trace")
        request = {
            "file": str(file),
            "result": str(result),
            "trace": str(trace),
            "sample_period": sample_period,
            "coupled": coupled,
            "axes": axes,
            "time_limit": time_limit,
            "memory_limit": memory_limit,
        }
        # -P: a file in the current folder is not to come before the standard library
        command = [sys.executable, "-P", "-m", "rds.checks.worker", json.dumps(request)]
        ended = run_child(command, time_limit + _START_UP, os.environ | _ENVIRONMENT, pulse)
        return _report(file, _events(result), ended, _place(trace, file))


def _report(file: Path, events: list[dict[str, Any]], ended: ChildEnd, place: str) -> FileReport:
    reports: list[CheckReport] = []
    warnings: list[Fault] = []
    current, complete = "file", False
    for event in events:
        if "error" in event:
            raise _error(event["error"])
        try:
            if "report" in event:
                reports.append(read_report(event["report"]))
            elif "warnings" in event:
                warnings += read_faults(event, "warnings")
        except ValueError:  # not what the worker writes: the student's code wrote to its file
            continue
        current = event["begin"] if event.get("begin") in _FUNCTION else current
        complete = complete or event.get("end") is True
    if not complete or not reports:
        reports.append(CheckReport(current, file.name, (_ending(current, ended, place),)))
    for stream, output in (("stdout", ended.out), ("stderr", ended.err)):
        if output.start.strip():
            lines = max(1, output.lines)
            said = f"it wrote {lines} line{'s' if lines > 1 else ''} to {stream} during the check, first: "
            message = f"{said}{output.first_line()!r:.200}; output takes time from the sample"
            warnings.append(Fault(clauses.PRINTS, message))
    return FileReport(str(file), tuple(reports), tuple(warnings))


def _ending(interface: str, ended: ChildEnd, place: str) -> Fault:
    what = _FUNCTION[interface]
    if ended.code is None or (place and ended.code == 1):  # 1: the worker's own time limit
        said = f"{what} does not return{place and ': it was still at ' + place}"
        return Fault(clauses.RETURNS, f"{said}; look for a loop without an end, a wait or input()")
    if ended.code < 0:
        name = signal.Signals(-ended.code).name if -ended.code in set(signal.Signals) else str(-ended.code)
        said = f"{what} took the interpreter down ({name}){place and ', at ' + place}"
        return Fault(clauses.RUNS, f"{said}; look at compiled code, deep recursion and memory")
    said = f"{what} ended its process, with exit code {ended.code}{place and ', at ' + place}"
    return Fault(clauses.RUNS, f"{said}; remove os._exit and the like")


def _events(result: Path) -> list[dict[str, Any]]:
    try:
        with result.open("rb") as stream:
            text = stream.read(_LARGEST).decode("utf-8", "replace")
    except OSError:  # the worker did not get as far
        return []
    return [event for line in text.splitlines() for event in _parsed(line)]


def _parsed(line: str) -> Iterator[dict[str, Any]]:
    try:
        event = json.loads(line)
    except ValueError:  # cut off in the middle
        return
    if isinstance(event, dict):
        yield event


def _error(data: Any) -> InputError:
    if not isinstance(data, dict):
        return InputError(f"it cannot be loaded: {data!r:.200}")
    kind = ContractError if data.get("contract") else InputError
    where = data.get("where")
    return kind(str(data.get("message")), str(where) if where else None)


def _place(trace: Path, file: Path) -> str:
    """The innermost line of the student's file in the stack that was dumped: "file.py, line 3, in control: `...`"."""
    try:
        stack = re.findall(r'File "(.+)", line (\d+) in (\S+)', trace.read_text(errors="replace"))
        if not stack or not file.is_file():  # a pipe or a device, which the worker has refused, may have no end
            return ""
        source = file.resolve().read_text(errors="replace").splitlines()
    except (OSError, RuntimeError):  # RuntimeError: how Path.resolve tells of a loop of links before Python 3.13
        return ""
    for name, number, function in stack:
        if Path(name) == file.resolve() and 0 < int(number) <= len(source):
            return f"{file.name}, line {number}, in {function}: `{source[int(number) - 1].strip()}`"
    return ""
