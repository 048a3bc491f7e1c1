"""The budget of work is a count: the same each time, on a busy computer too, and not to be tampered with."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rds.core.types import Reference
from rds.grading.sandbox import Counts, Pool

Written = Callable[..., Path]
WORK = """
initial_state = [0.0]
def control(t, r, y, state, params):
    total = 0.0
    for n in range(ROUNDS):
        total += abs(r.position - y) * n
    return min(total, 1.0), [total]
"""


def counts(pool: Pool, path: Path, samples: int = 50) -> Counts:
    """Of a run of as many samples."""
    with pool.open(path) as subject:
        subject.begin_control(T=1e-3)
        for k in range(samples):
            subject.control(k * 1e-3, Reference(k * 0.01, 0.0, 0.0), 0.0)
        return subject.counts


def test_more_work_is_more_events_in_proportion(pool: Pool, written: Written) -> None:
    few, more, most = (counts(pool, written(WORK.replace("ROUNDS", str(n)), "")).events or 0 for n in (0, 10, 20))
    assert few > 0
    assert more - few == most - more > 10 * 50 * 2  # rounds, samples, at least two lines each


def test_the_count_is_the_same_on_a_busy_computer(pool: Pool, written: Written) -> None:
    path = written(WORK.replace("ROUNDS", "20"), "")
    quiet = counts(pool, path)
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
    try:
        assert counts(pool, path) == counts(pool, path) == quiet
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert quiet.refused == ""


@pytest.mark.parametrize(
    ("attack", "said"),
    [
        ("import sys; sys.settrace(None)", "sys.settrace is not allowed"),
        ("import sys; sys.setprofile(None)", "sys.setprofile is not allowed"),
        ("import gc; gc.get_objects()", "gc.get_objects is not allowed"),
        ("import ctypes; ctypes.c_int.from_address(id(0))", "ctypes"),
        ("import os; os.fork()", "os.fork is not allowed"),
        ("import threading; threading.Thread(target=int).start()", "can't start new thread"),
        ("import sys; sys._getframe().f_back.f_trace = None", "sys._getframe is not allowed"),
    ],
)
def test_who_reaches_for_the_counter_gets_no_count(attack: str, said: str, pool: Pool, written: Written) -> None:
    text = f"initial_state = ()\ndef control(t, r, y, state, params):\n    {attack}\n    return 1.0, state\n"
    found = counts(pool, written(text, ""), samples=2)
    assert found.events is None
    assert said in found.refused


def test_who_answers_otherwise_while_it_is_counted_gets_no_count(pool: Pool, written: Written) -> None:
    text = "import sys\ninitial_state = ()\ndef control(t, r, y, state, params):\n"
    text += "    return float(sys.gettrace() is None), state\n"
    found = counts(pool, written(text, ""), samples=2)
    assert found == Counts(2, None, "at t = 0.000 s it answered otherwise while it was counted")


def test_models_and_interpolators_are_counted_too(pool: Pool, written: Written) -> None:
    text = "def derivatives(t, x, u, params): return [x[1], u[0] - x[1]]\n"
    with pool.open(written(text, ""), kind="model") as subject:
        subject.begin_model(T=1e-3)
        for _ in range(10):
            subject.advance(1.0)
        assert subject.count(5).calls == 5
        first = subject.counts
        assert first.calls == 10
        assert first.events is not None
        assert first.events > 40
