"""Nothing is left behind, whoever ends: the submission, the pool, its warm interpreter, or the grader itself."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from waiting import wait_for

from rds.core.types import Reference
from rds.grading.sandbox import Limits, Pool, SandboxError, available
from rds.grading.sandbox import requirements as requirements
from rds.grading.sandbox.budget import Budget
from rds.grading.sandbox.cell import Cell
from rds.grading.sandbox.supervise import Supervisor

Written = Callable[..., Path]

GRADER = """
import sys
from rds.grading.sandbox import Pool
with Pool() as pool, pool.open(sys.argv[1]) as subject:
    subject.begin_control()
    print(subject._cell._process, flush=True)
    subject.control(0.0, (0.0, 0.0, 0.0), 0.0)
"""
DAEMONS = """
import os, time
initial_state = ()
def control(t, r, y, state, params):
    for _ in range(3):
        if os.fork() == 0:
            os.setsid()
            time.sleep(600)
    time.sleep(600 if params["waits"] else 0)
    return 1.0, state
"""


def descendants(process: int) -> list[int]:
    """The numbers of all processes below `process`."""
    found = []
    for file in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            below = [int(number) for number in file.read_text().split()]
        except OSError:
            continue
        found += below + [each for number in below for each in descendants(number)]
    return found


def wait_for_end(numbers: list[int]) -> list[int]:
    """Those of `numbers` that still run after 10 s."""
    end = time.monotonic() + 10.0
    while (left := [n for n in numbers if Path(f"/proc/{n}").exists()]) and time.monotonic() < end:
        time.sleep(0.01)
    return left


def test_a_closed_pool_holds_nothing_open(pool: Pool) -> None:
    before = len(os.listdir("/proc/self/fd"))
    with Pool() as own:
        kept = [*own._interpreters.values()]  # whoever still refers to it
    assert len(os.listdir("/proc/self/fd")) == before
    assert not any(each.is_alive for each in kept)


def test_a_cell_that_could_not_be_started_holds_nothing_open() -> None:
    class Gone:
        resident_bytes = 0

        def fork(self, _request: object, _fds: object) -> None:
            raise SandboxError("the warm interpreter is gone")

    supervisor, before = Supervisor(), len(os.listdir("/proc/self/fd"))
    with pytest.raises(SandboxError, match="is gone"):
        Cell(Gone(), Budget(Limits()), supervisor)  # type: ignore[arg-type]
    supervisor.close()
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.usefixtures("pool")
def test_a_grader_that_is_killed_leaves_no_process(written: Written) -> None:
    path = written(DAEMONS, "params = {'waits': True}\n")
    grader = subprocess.Popen([sys.executable, "-c", GRADER, str(path)], stdout=subprocess.PIPE, text=True)
    assert grader.stdout
    init = int(grader.stdout.readline())
    wait_for(lambda: len(descendants(init)) >= 4)
    below = [init, *descendants(init), *descendants(grader.pid)]
    assert len(descendants(init)) == 4
    grader.kill()
    grader.wait()
    grader.stdout.close()
    assert wait_for_end(below) == []


def test_daemons_end_with_their_case(pool: Pool, written: Written) -> None:
    with pool.open(written(DAEMONS, "params = {'waits': False}\n")) as subject:
        subject.begin_control()
        assert subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0) == 1.0
        assert subject._cell
        below = [subject._cell._process, *descendants(subject._cell._process)]
        assert len(below) == 5
    assert wait_for_end(below) == []


def test_a_warm_interpreter_that_is_killed_is_started_anew(written: Written, pool: Pool) -> None:
    with Pool() as other:
        with other.open(written("")):
            pass
        (interpreter,) = other._interpreters.values()
        os.kill(interpreter._process.pid, signal.SIGKILL)
        interpreter._process.wait()
        with other.open(written("")) as subject:
            subject.begin_control()
            assert subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0) == 1.0


def test_descriptors_and_processors_are_given_back(pool: Pool, written: Written) -> None:
    path = written("")
    before = len(os.listdir("/proc/self/fd")), os.sched_getaffinity(0)
    for _ in range(5):
        with pool.open(path) as subject:
            subject.begin_control()
            subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
            subject.begin_control()
    assert (len(os.listdir("/proc/self/fd")), os.sched_getaffinity(0)) == before


@pytest.mark.parametrize(("program", "said"), [("bwrap", "sudo apt install bubblewrap")])
def test_what_is_missing_is_said_with_the_command(program: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requirements.shutil, "which", lambda name: None if name == program else "/usr/bin/" + name)
    assert said in (requirements.missing() or "")
    monkeypatch.setattr(requirements.sys, "platform", "darwin")
    assert "Linux" in (requirements.missing() or "")


def test_a_hole_is_found(pool: Pool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rds.grading.sandbox.interpreter.submission_filter", lambda: everything())
    available.cache_clear()
    try:
        assert "it could open a socket" in (available() or "")
    finally:
        available.cache_clear()


def everything() -> bytes:
    """A filter that lets every system call through."""
    import pyseccomp

    from rds.grading.sandbox.seccomp_filter import _exported

    return _exported(pyseccomp.SyscallFilter(pyseccomp.ALLOW))
