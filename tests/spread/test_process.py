"""A worker process from outside, where its time and its answer meet."""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from typing import Any

import pytest
import spread_functions

import rds.core.parallel.process
from rds.core.parallel.local import place
from rds.core.parallel.outcome import Failure
from rds.core.parallel.pipe import FUNCTION, send
from rds.core.parallel.process import Work, WorkerProcess
from rds.core.parallel.remote import places
from rds.core.portable import portable

LIMIT = 2.0  # s


def test_an_answer_that_meets_the_end_of_its_time_costs_the_next_item_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    real, late = (
        rds.core.parallel.process.receive,
        [0.0, 1.2 * LIMIT],
    )  # of what a process says: that it is ready, an answer

    def receive(stream: Any) -> bytes:
        said = real(stream)
        time.sleep(late.pop(0) if late else 0.0)
        return said

    monkeypatch.setattr(rds.core.parallel.process, "receive", receive)
    process = WorkerProcess(Work.of(spread_functions.square, retries=0, time_limit=LIMIT), {})
    try:
        first, second = (process.answer(portable(x)).outcome(0) for x in (2.0, 3.0))
    finally:
        process.end()
        process.close()
    assert (first.failure, second.failure, second.value) == (Failure.OVERDUE, None, 9.0)


def test_a_process_that_was_started_ahead_does_other_work_afterwards() -> None:
    process = WorkerProcess(Work.of(spread_functions.number, retries=0, time_limit=None), place(3, 8))
    try:
        process.ask_ahead(portable("first"))
        first = process.answer(portable("first")).outcome(0).value
        process.take(Work.of(spread_functions.square, retries=0, time_limit=None))
        assert process.answer(portable(3.0)).outcome(1).value == 9.0
        process.take(Work.of(spread_functions.number, retries=0, time_limit=None))
        assert process.answer(portable("last")).outcome(2).value == first  # the same process still
    finally:
        process.end()
        process.close()
    assert first[1:] == (3, 8)


def test_a_process_whose_answer_nobody_reads_ends_without_a_word() -> None:
    command = [sys.executable, "-P", "-m", "rds.core.parallel.worker"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe) as process:
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        process.stdout.close()
        send(process.stdin, pickle.dumps(sys.path))
        send(process.stdin, FUNCTION + portable(spread_functions.square))
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_workers_of_a_cluster_are_counted_by_their_computers() -> None:
    workers = {f"tcp://{host}:{n}": {"host": host, "nthreads": n} for host, n in (("a", 1), ("b", 2), ("a", 3))}
    assert places(workers) == {"tcp://a:1": (0, 4), "tcp://b:2": (0, 2), "tcp://a:3": (1, 4)}
