"""A worker process from outside, where its time and its answer meet."""

from __future__ import annotations

import time
from typing import Any

import pytest
import spread_functions

import rds.core.parallel.process
from rds.core.parallel.outcome import Failure
from rds.core.parallel.process import Work, WorkerProcess
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
