"""The process in which a student's file is checked: `python -m rds.checks.worker REQUEST`.

REQUEST is a JSON text: `file`, `result`, `trace` (paths), `sample_period` (s), `coupled`, `axes`, `time_limit` (s),
`memory_limit` (bytes). What is found goes to `result`, one JSON object a line as it comes, so that a file which takes
the interpreter down loses only what comes after: {"begin": interface}, {"report": ...}, {"warnings": [...]},
{"error": ...} and last {"end": true}. `trace` gets the stack of a crash, or of what runs when the time is over.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.core.garbage import collect_rarely

    collect_rarely()

import contextlib
import faulthandler
import json
import os
import sys
from typing import IO, Any

from rds.checks import clauses
from rds.checks.controller import check_controller
from rds.checks.interpolator import check_interpolator
from rds.checks.model import check_model
from rds.checks.report import CheckReport, Fault
from rds.core.blame import student_error
from rds.core.errors import ContractError, InputError
from rds.core.load import load_student
from rds.core.private_files import keep_process_private, open_private
from rds.core.signature import form

_PASSES = 20  # the time limit holds this many passes over a run, and some


def check_loaded(interface: str, file: Any, request: dict[str, Any]) -> CheckReport:
    """The check of one interface of a file or of anything else that the checks take."""
    T, budget = request["sample_period"], request["time_limit"] / _PASSES
    if interface == "controller":
        coupled = request["coupled"] or None  # a Controller knows itself
        return check_controller(file, T, coupled=coupled, axes=request["axes"], budget=budget)
    check = check_model if interface == "model" else check_interpolator
    return check(file, T, budget=budget)


def run(request: dict[str, Any], result: IO[str]) -> None:
    """Load the file and check each interface that it fills; every step is on disk before the next begins."""

    def say(event: dict[str, Any]) -> None:
        result.write(json.dumps(event) + "\n")
        result.flush()

    say({"begin": "file"})
    interface, path = "file", request["file"]
    try:
        student = load_student(path, validate=False)
        if request["coupled"] and "controller" not in student.interfaces:
            raise InputError(f"it is to be checked as a coupled controller, and it defines no {form('control')}", path)
        warnings = [
            Fault(clauses.OTHERS, f"{name}() is taken for a helper: {why}") for name, why in student.misfits.items()
        ]
        say({"warnings": [{"clause": w.clause, "message": w.message} for w in warnings]})
        for interface in student.interfaces:
            say({"begin": interface})
            say({"report": check_loaded(interface, path, request).to_json()})
    except InputError as error:
        where = error.where or ""
        text = str(error).removeprefix(f"{where}: ") if where else str(error)
        say({"error": {"contract": isinstance(error, ContractError), "message": text, "where": error.where}})
    except BaseException as error:  # the student's code may raise anything, and nobody else is at this process's keys
        said = f"it raised {student_error(error, path)}; an error of its own is an Exception"
        report = CheckReport(interface, os.path.basename(path), (Fault(clauses.RUNS, said),))
        say({"report": report.to_json()})
    say({"end": True})


def limit_memory(size: int) -> None:
    """Hold this process to `size` bytes of address space, where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    with contextlib.suppress(ValueError, OSError):  # a lower limit is in force already
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def main() -> None:
    """Do what the command line's request says, and end without waiting for threads that the student left."""
    request = json.loads(sys.argv[1])
    sys.argv[:] = [request["file"]]
    with (
        open_private(request["trace"], "w", is_own=True) as trace,
        open_private(request["result"], "w", is_own=True, encoding="utf-8") as result,
    ):
        faulthandler.enable(trace)
        faulthandler.dump_traceback_later(request["time_limit"], exit=True, file=trace)
        limit_memory(request["memory_limit"])
        run(request, result)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


if __name__ == "__main__":
    keep_process_private()
    main()
