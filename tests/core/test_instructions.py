"""The counter of instructions: its path by a software counter, and its refusal."""

from __future__ import annotations

import sys
import time

import numpy as np
import pytest

from rds.core.instructions import SOFTWARE, TASK_CLOCK, InstructionCounter, computing_times
from rds.core.types import Verdict
from rds.modes.process.timing import Timing, judge

MS = 1_000_000
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the counters are Linux's")


def test_calls_are_counted_and_overruns_kept() -> None:
    """By the kernel's clock of the task, whose instructions are nanoseconds."""
    counter = InstructionCounter(10 * MS, SOFTWARE, TASK_CLOCK)
    assert not counter.reason
    for computes, took in ((0.002, MS), (0.002, MS), (0.004, 40 * MS)):
        counter.begin()
        end = time.thread_time() + computes
        while time.thread_time() < end:
            pass
        counter.end(took)
    counter.begin()
    time.sleep(0.03)  # counts nothing
    counter.end(30 * MS)
    told = counter.to_json()
    counter.close()
    assert told["usual"] >= 4 * MS and told["usual_ns"] == 2 * MS
    computed, slept = told["overruns"]
    assert computed >= 4 * MS > slept
    assert computing_times(told) == [computed * 2 * MS / told["usual"], slept * 2 * MS / told["usual"]]


def test_a_counter_that_there_is_not_says_why_and_counts_nothing() -> None:
    counter = InstructionCounter(MS, kind=99)
    counter.begin()
    counter.end(5 * MS)
    counter.close()
    assert counter.to_json() == {"not_available": counter.reason}
    assert counter.reason.startswith("perf_event_open fails with E")
    assert computing_times(counter.to_json()) == [] == computing_times({})


def test_a_call_that_computed_more_is_blamed_where_it_cannot_be_made_again() -> None:
    """One call of 5 ms beside a stall of 4 ms: by its time alone nobody can say whose it was."""
    computed = np.full(1000, 0.05) * MS
    computed[500] = 5.0 * MS
    lateness = np.zeros(1000)
    lateness[200] = 4.0 * MS
    nothing = np.zeros(1000)
    timing = Timing(np.arange(1000), lateness, np.full(1000, 0.1) * MS, nothing, computed, nothing, nothing)
    counted = {"usual": 999 * 100_000, "usual_ns": 999 * 50_000}
    for instructions, verdict in ((10_000_000, Verdict.MISSED), (100_000, Verdict.VOID), (None, Verdict.VOID)):
        told = {"not_available": "no"} if instructions is None else counted | {"overruns": [instructions]}
        assert judge(timing, MS, environment={"instructions": told}).verdict == verdict
