"""What a submission may use up, and that the limits hold for all its processes together."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rds.core.types import Reference
from rds.grading.grade import Status
from rds.grading.sandbox import Limits, Pool, SandboxError, SubmissionError, processes
from rds.grading.sandbox.budget import Budget

Written = Callable[..., Path]
MIB = 1 << 20
NOW = (0.0, Reference(0.0, 0.0, 0.0), 0.0)

ATTACKS = {
    "endless loop": ("while True: pass", Limits(load_seconds=0.5), Status.TIMED_OUT, "no answer for 0.5 s"),
    "sleep": ("import time; time.sleep(60)", Limits(load_seconds=0.5), Status.TIMED_OUT, "no answer for 0.5 s"),
    "computing": ("while True: pass", Limits(cpu_seconds=0.3), Status.TIMED_OUT, "computing time"),
    "computing that nobody looked at in time": (
        "import resource, signal\nsoft, hard = resource.getrlimit(resource.RLIMIT_CPU)\n"
        "if soft < hard: signal.raise_signal(signal.SIGXCPU)  # as the kernel does then; at the hard limit it kills\n",
        Limits(),
        Status.TIMED_OUT,
        "more computing time than is allowed",
    ),
    "fork bomb": (
        "import os\nwhile True:\n    try: os.fork()\n    except OSError: pass\n",
        Limits(cpu_seconds=1.0),
        Status.TIMED_OUT,
        "computing time|no answer",
    ),
    "work in children": (
        "import os\nfor _ in range(3):\n    if not os.fork():\n        while True: pass\nimport time; time.sleep(60)\n",
        Limits(cpu_seconds=0.5, load_seconds=60.0),
        Status.TIMED_OUT,
        "computing time",
    ),
    "memory of one process": (
        "kept = []\nwhile True: kept.append(bytearray(1 << 22))\n",
        Limits(memory_bytes=128 * MIB),
        Status.FAILED_TO_LOAD,
        "MemoryError",
    ),
    "memory of all processes": (
        "import os, time\nfor _ in range(4):\n    if not os.fork(): break\nx = bytearray(os.urandom(1 << 20)) * 100\n"
        "time.sleep(60)\n",
        Limits(memory_bytes=256 * MIB),
        Status.KILLED,
        "MiB of memory; 256 MiB are allowed",
    ),
    "flood": ("while True: print('x' * 9999)", Limits(output_bytes=10_000), Status.KILLED, "printed more than 10000"),
    "full disk": (
        "for n in range(99):\n    with open(f'/tmp/{n}', 'wb') as file: file.write(bytes(1 << 20))\n",
        Limits(file_bytes=4 * MIB),
        Status.FAILED_TO_LOAD,
        "No space left",
    ),
    "many files": (
        "for n in range(9999): open(f'/tmp/{n}', 'wb').close()\n",
        Limits(),
        Status.FAILED_TO_LOAD,
        "No space left",
    ),
}


@pytest.mark.parametrize("name", ATTACKS)
def test_a_limit_holds_and_the_next_submission_is_unaffected(name: str, pool: Pool, written: Written) -> None:
    text, limits, status, said = ATTACKS[name]
    with pytest.raises(SubmissionError, match=said) as caught:
        pool.open(written("import os\nassert os.getpid() == 2\n" + text), limits)
    assert caught.value.status is status
    with pool.open(written("", name="next.py")) as subject:
        subject.begin_control()
        assert subject.control(*NOW) == 1.0


def test_processes_and_threads_are_counted_together(pool: Pool, written: Written) -> None:
    text = """
import os, threading, time
def count():
    children = threads = 0
    try:
        while children < 3:
            if os.fork() == 0:
                time.sleep(60)
            children += 1
        while threads < 50:
            threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
            threads += 1
    except (OSError, RuntimeError):
        pass
    return [children, threads]
"""
    with pool.open(written(text, ""), Limits(processes=6), kind="functions") as subject:
        assert subject.call("count") == [3, 2]  # and itself


def test_one_call_may_take_as_long_as_one_call_may_take(pool: Pool, written: Written) -> None:
    text = "import time\ninitial_state = ()\ndef control(t, r, y, state, params):\n    time.sleep(60)\n"
    with pool.open(written(text, ""), Limits(call_seconds=0.3)) as subject:
        subject.begin_control()
        with pytest.raises(SubmissionError, match=r"no answer for 0\.3 s") as caught:
            subject.control(*NOW)
    assert caught.value.status is Status.TIMED_OUT


def test_computing_time_adds_up_over_the_cases(pool: Pool, written: Written) -> None:
    text = "import time\nend = time.process_time() + 0.4\nwhile time.process_time() < end: pass\n"
    with pool.open(written(text), Limits(cpu_seconds=1.0)) as subject:
        subject.begin_control()
        with pytest.raises(SubmissionError, match="computing time in all") as caught:
            for _ in range(4):
                subject.begin_control()
    assert caught.value.status is Status.TIMED_OUT


def test_much_talk_is_cut_and_goes_on(pool: Pool, written: Written) -> None:
    text = "for n in range(300): print('%09d' % n)\n"
    with pool.open(written(text), Limits(output_bytes=1000)) as subject:
        subject.begin_control()
        assert subject.control(*NOW) == 1.0
    assert subject.output.startswith("000000000\n000000001\n")
    assert subject.output.endswith("… 2000 bytes more were cut")


def test_a_computer_that_stood_still_is_not_the_submissions_doing() -> None:
    budget = Budget(Limits(wall_seconds=10.0, call_seconds=2.0))
    turn = sum(budget.step(30.0) for _ in range(10))
    assert turn == pytest.approx(1.0)
    assert budget.fault(cpu=0.0, memory=0, turn=turn, turn_limit=2.0) is None


def test_a_computer_without_memory_is_not_the_submissions_doing(
    pool: Pool, written: Written, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the kernel ends for want of memory is graded again; what ends itself is not, whatever happened before."""
    path = written("import os\ninitial_state = 0\ndef control(*_): os.kill(os.getpid(), 9)\n", "")
    for happened, error in ((0, SubmissionError), (1, SandboxError)):
        with pool.open(path) as subject:
            subject.begin_control()
            counted = subject._budget.ended_for_memory + happened
            monkeypatch.setattr("rds.grading.sandbox.cell.ended_for_memory", lambda counted=counted: counted)
            with pytest.raises(error):
                subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)


def test_the_kernel_would_end_a_submission_first(pool: Pool, written: Written) -> None:
    with pool.open(written("")) as subject:
        assert subject._cell is not None
        assert Path(f"/proc/{subject._cell._process}/oom_score_adj").read_text() == "1000\n"


def test_memory_that_was_swapped_out_is_still_held(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process can ask the kernel to swap it out, and would hold it out of sight."""
    files = {
        "/proc/7/task/7/children": b"8 ",
        "/proc/8/status": b"Name:\tpython\nVmPeak:\t 900 kB\nVmRSS:\t     100 kB\nVmSwap:\t     700 kB\nThreads:\t1\n",
    }
    monkeypatch.setattr(processes, "_read", lambda path: files.get(path, b""))
    monkeypatch.setattr(processes, "_threads", lambda process: [str(process)])
    assert processes.usage(7).memory_bytes == 800 << 10
