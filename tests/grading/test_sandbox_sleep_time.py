"""Who sleeps while it has to answer is found out, though awake at every look; who waits for a processor is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rds.core.types import Reference
from rds.grading.sandbox import Limits, Pool, SubmissionError
from rds.grading.sandbox.processes import ThreadTimes
from rds.grading.sandbox.sleep_time import SleepTime

LOOK = 0.02  # s


def looks(
    computed: float, waited: float, sleeps: int, is_same: bool, graded: float = 0.0, held: float = 0.0
) -> SleepTime:
    """After 100 looks, between which so many seconds each were computed and waited."""
    asleep = SleepTime()
    for n in range(101):
        answering, grading = ThreadTimes(n * computed, n * waited), ThreadTimes(n * graded, n * held)
        asleep.look(LOOK, answering, grading, n * sleeps, is_same)
    return asleep


def test_one_answer_that_is_slept_away() -> None:
    found = looks(0.001, 0.0, sleeps=1, is_same=True)
    assert found.slept
    assert found.own == pytest.approx(100 * LOOK)


def test_one_answer_that_waits_for_a_processor() -> None:
    assert looks(0.001, 0.019, sleeps=1, is_same=True).own == pytest.approx(100 * 0.001)
    assert not looks(0.02, 0.0, sleeps=0, is_same=True).slept


def test_a_wait_that_is_told_late_is_taken_back() -> None:
    """The kernel adds a wait when it is over: one of 0.1 s across five looks."""
    asleep = SleepTime()
    for waited in (0.0, 0.0, 0.0, 0.0, 0.0, 0.1):
        asleep.look(LOOK, ThreadTimes(0.0, waited), ThreadTimes(0.0, 0.0), 0, True)
    assert asleep.own == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("computed", "waited", "graded", "held", "between"),
    [
        (0.001, 0.0, 0.001, 0.0, 0.018),  # asleep at each answer
        (0.015, 0.0, 0.004, 0.0, 0.0),  # at work
        (0.002, 0.016, 0.001, 0.0, 0.0),  # other programs have the processors
        (0.002, 0.0, 0.001, 0.016, 0.0),
        (0.001, 0.0, 0.018, 0.0, 0.0),  # it is the grader that computes
        (0.012, 0.0, 0.001, 0.0, 0.0),  # little: stolen by a neighbour of the virtual machine
    ],
)
def test_many_answers(computed: float, waited: float, graded: float, held: float, between: float) -> None:
    assert looks(computed, waited, 1, False, graded, held).between == pytest.approx(between)


def test_a_kernel_that_does_not_tell() -> None:
    asleep = SleepTime()
    for _ in range(3):
        asleep.look(LOOK, None, None, 5, True)
    assert (asleep.slept, asleep.own, asleep.between) == (False, 0.0, 0.0)


def test_what_is_told_of_a_submission(pool: Pool, written: Callable[..., Path]) -> None:
    """It sleeps 17 of 20 ms and computes for the rest: the limit is for the whole of it."""
    text = """
import time
initial_state = ()
def control(t, r, y, state, params):
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        time.sleep(0.017)
        awake = time.process_time() + 0.003
        while time.process_time() < awake: pass
    return 1.0, state
"""
    with pool.open(written(text, ""), Limits(call_seconds=0.5)) as subject:
        subject.begin_control()
        with pytest.raises(SubmissionError, match=r"no answer for 0\.5 s"):
            subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
        assert subject._budget.cpu_before < 0.4
