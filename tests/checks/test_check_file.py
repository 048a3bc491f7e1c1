"""Whole files, checked in a process of their own: whatever they do, a report or an error with its place comes back."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from rds.checks import check, check_file, clauses
from rds.checks.report import read_report
from rds.core.errors import ContractError, InputError

CONTROL = """
def control(t, r, y, state, params):
    {body}
    return 5.0 * (r.position - y), state
"""


@pytest.fixture
def write(tmp_path):
    """Write a student's file, and give its path."""

    def write(text, name="mine.py"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def with_body(body: str, before: str = "") -> str:
    return before + CONTROL.format(body=body)


GOOD_FILE = """
import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from helpers import clip

LIMIT = 10.0
TABLE = np.linspace(0.0, 1.0, 50)
params = {"P": 20.0}


class Phase(Enum):
    START = 1
    RUN = 2


@dataclass(frozen=True)
class State:
    z: float = 0.0
    phase: Phase = Phase.START


initial_state = State()


def control(t, r, y, state, params):
    z = -318.0 * y if state.phase is Phase.START else state.z
    u = clip(params["P"] * (r.position - y) + 0.01 * (r.velocity - z - 318.0 * y), LIMIT)
    u += float(np.interp(abs(y), [0.0, 10.0], TABLE[[0, -1]]))
    return u, replace(state, z=0.7 * z - 90.0 * y, phase=Phase.RUN)


def interpolate(segment, T, params):
    if hasattr(segment, "centre"):
        raise NotImplementedError("lines only")
    length = math.dist(segment.start, segment.end)
    n = math.ceil(length / segment.feed_rate / T)
    a, b = np.array(segment.start), np.array(segment.end)
    for k in range(n + 1):
        yield a + (b - a) * k / n, (b - a) / (n * T), 0 * a
"""


def test_a_good_file_with_two_interfaces_and_a_helper_next_to_it(write):
    write("def clip(u, limit):\n    return max(-limit, min(limit, u))\n", "helpers.py")
    report = check_file(write(GOOD_FILE))
    assert report.ok, str(report)
    assert report.interfaces == ("controller", "interpolator")
    assert not report.warnings and not any(r.warnings for r in report.reports), str(report)
    assert json.loads(json.dumps(report.to_json()))["ok"] is True


def test_a_model_that_uses_python_control(write):
    text = "import control\nimport numpy as np\nplant = control.ss([[0, 1], [0, -100]], [[0], [177]], [[1, 0]], 0)\n"
    text += "def derivatives(t, x, u, params):\n    return plant.dynamics(t, x, u, params)\n"
    report = check_file(write(text))
    assert report.ok, str(report)
    assert report.interfaces == ("model",)


BAD = [
    ("while t > 0.1: pass", clauses.RETURNS, "mine.py, line 3, in control: `while t > 0.1: pass`"),
    ("import os; os._exit(0)", clauses.RUNS, "exit code 0"),
    ("import ctypes; ctypes.string_at(0)", clauses.RUNS, "mine.py, line 3, in control"),
    ("import sys; sys.exit(1)", clauses.RUNS, "SystemExit"),
    ("control(t, r, y, state, params)", clauses.RUNS, "RecursionError"),
    ("raise KeyboardInterrupt", clauses.RUNS, "KeyboardInterrupt"),
    ("return bytearray(1 << 40)", clauses.RUNS, "MemoryError"),
    ("input('u = ')", clauses.RUNS, "EOFError"),
    ("return undefined, state", clauses.RUNS, "NameError: name 'undefined'"),
    ("return '1', state", clauses.VOLTAGE, "'1' (str)"),
    ("params.clear(); params['x'] = 1", clauses.UNCHANGED, "'x'"),
]


@pytest.mark.parametrize(("body", "clause", "detail"), BAD, ids=[b[0][:20] for b in BAD])
def test_hostile_code_is_a_fault_that_names_its_line(write, body, clause, detail):
    limit = 1.5 if clause == clauses.RETURNS else 3.0  # s that the first one computes for
    report = check_file(write(with_body(body)), time_limit=limit)
    (controller,) = report.reports
    assert controller.interface == "controller"
    assert [fault.clause for fault in controller.faults] == [clause], str(report)
    assert detail in str(report)


REMEMBERS = [
    ("memory[t] = y; y = memory.get(round(t - 0.001, 9), y)", "memory = {}", clauses.MEMORY, "global `memory`"),
    ("import random; y += random.random()", "", clauses.DETERMINISTIC, "`random`"),
    ("y += rng.random()", "import random\nrng = random.Random(1)\n", clauses.MEMORY, "global `rng`"),
    ("y += time.time() % 1", "import time\n", clauses.DETERMINISTIC, "`time`"),
    ("y += store.add(y)", "import store\n", clauses.MEMORY, "global `total` of store"),
]


@pytest.mark.parametrize(("body", "before", "clause", "detail"), REMEMBERS, ids=[r[0][:20] for r in REMEMBERS])
def test_memory_and_chance_are_told_apart_by_a_fresh_copy(write, body, before, clause, detail):
    write("total = 0.0\ndef add(y):\n    global total\n    total += y\n    return total\n", "store.py")
    (report,) = check_file(write(with_body(body, before))).reports
    assert [fault.clause for fault in report.faults] == [clause], str(report)
    assert detail in str(report)


def test_what_does_not_return_while_it_loads_is_a_fault_of_the_file(write):
    (report,) = check_file(write("import time\nwhile True:\n    time.sleep(0.01)\n"), time_limit=2.0).reports
    assert report.interface == "file"
    assert "mine.py, line" in str(report) and clauses.RETURNS in str(report)


def test_what_was_found_before_a_crash_is_kept(write):
    text = with_body("pass") + "def interpolate(segment, T, params):\n    import os\n    os.abort()\n"
    report = check_file(write(text))
    assert [(r.interface, r.ok) for r in report.reports] == [("controller", True), ("interpolator", False)]
    assert "SIGABRT" in str(report) or "exit code" in str(report)


def test_prints_do_not_disturb_the_report(write, capfd):
    report = check_file(write(with_body('print("{\\"end\\": true}" * 1000)', 'print("loading")\n')))
    assert report.ok
    assert [warning.clause for warning in report.warnings] == [clauses.PRINTS]
    assert "'loading'" in str(report)
    assert capfd.readouterr() == ("", "")


def test_a_thread_and_a_process_that_stay_behind_do_not_hold_it_up(write):
    before = "import subprocess, sys, threading, time\nthreading.Thread(target=time.sleep, args=(60,)).start()\n"
    before += "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])\n"
    assert check_file(write(with_body("pass", before)), time_limit=20.0).reports[0].interface == "controller"


@pytest.mark.parametrize(
    ("text", "kind", "parts"),
    [
        ("x = (\n", InputError, ["mine.py:1", "syntax error"]),
        ("1 / 0\n", InputError, ["mine.py:1", "ZeroDivisionError"]),
        ("x = 1\n", InputError, ["defines none of"]),
    ],
)
def test_a_file_that_cannot_be_loaded_raises(write, text, kind, parts):
    with pytest.raises(kind) as caught:
        check_file(write(text))
    assert all(part in str(caught.value) for part in parts)


def test_a_missing_file_raises(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        check_file(tmp_path / "none.py")


def test_a_link_that_leads_to_itself_raises(tmp_path):
    loop = tmp_path / "loop.py"
    loop.symlink_to(loop)
    with pytest.raises(InputError, match=r"loop\.py"):
        check_file(loop)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_refused_without_waiting_for_its_other_end(tmp_path):
    os.mkfifo(tmp_path / "law.py")
    with pytest.raises(InputError, match="it is not a regular file"):
        check_file(tmp_path / "law.py")


def test_a_wrong_signature_is_a_fault(write):
    (report,) = check_file(write("def control(t, r, y, state):\n    return 0.0, state\n")).reports
    assert [fault.clause for fault in report.faults] == [clauses.ARGUMENTS]


def test_a_helper_with_the_name_of_an_interface_is_worth_a_warning(write):
    report = check_file(write(with_body("pass", "def interpolate(table, x): return table[x]\n")))
    assert report.ok and [warning.clause for warning in report.warnings] == [clauses.OTHERS]


def test_a_state_that_serves_two_interfaces_is_explained(write):
    text = "initial_state = [0.0]\n" + with_body("state[0]")
    text += "def derivatives(t, x, u, params): return [x[1], u[0]]\n"
    report = check_file(write(text))
    assert "a file of its own" in str(report.reports[1])


def test_one_door_takes_anything(write):
    from rds.core.load import load_student

    path = write(with_body("pass"))
    student = load_student(path)
    for thing in (path, str(path), student, student.controller(), student.functions["control"], student.functions):
        report = check(thing)
        assert report.ok and report.interfaces == ("controller",), thing
    with pytest.raises(ContractError):
        check(lambda a, b: 0)


def test_a_model_made_from_a_file_is_checked_as_it_is(write):
    from rds.core.load import load_student
    from rds.models.student import student_model

    student = load_student(write("def derivatives(t, x, u, params): return [x[1], 177.0 * u[0] - 100.0 * x[1]]\n"))
    report = check(student_model(student))
    assert report.ok and report.interfaces == ("model",)


def test_a_file_that_was_edited_meanwhile_is_not_taken_for_a_copy(write):
    from rds.core.load import load_student

    student = load_student(write(with_body("pass")))
    write("def other(): pass\n")
    assert check(student).ok


@pytest.mark.parametrize("change", [{"faults": 3}, {"name": None}, {"timing": {"p50": "x"}}, {"notes": [1]}])
def test_a_report_is_not_trusted_blindly(change):
    good = {"interface": "controller", "name": "x", "faults": [], "warnings": [], "timing": None, "notes": []}
    assert read_report(good).ok
    with pytest.raises(ValueError):
        read_report(good | change)


def test_the_checks_are_light():
    code = "import sys, rds.checks.worker; print([n for n in ('control', 'scipy', 'matplotlib') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
