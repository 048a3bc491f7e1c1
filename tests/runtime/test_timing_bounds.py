"""Where verdicts from times turn over, and the numbers that their sentences say."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from made_timings import MS, N, ran, some, verdict

from rds.core.types import Verdict
from rds.modes.process.timing import Timing, judge, late_samples, summary


def test_up_to_three_overruns_are_in_doubt_on_a_system_that_never_stalled() -> None:
    def in_no_time(which: np.ndarray) -> np.ndarray:
        return np.zeros(len(which))

    assert verdict(compute=some(3, 2.0), again=in_no_time) == Verdict.VOID
    assert verdict(compute=some(4, 2.0), again=in_no_time) == Verdict.MISSED


def test_what_is_called_again_is_what_overran_with_its_share_of_the_bus() -> None:
    asked = []
    timing, counts = ran(compute=some(3, 0.92), io=0.1)  # 0.93 ms of their own
    judge(timing, MS, **counts, again=asked.append)
    assert np.flatnonzero(asked[0]).tolist() == [5, 338, 671]


@pytest.mark.parametrize("overruns, expected", [(1, Verdict.VOID), (2, Verdict.MISSED)])
def test_more_overruns_than_the_system_stalled_are_the_codes_although_none_is_long(
    overruns: int, expected: Verdict
) -> None:
    timing, counts = ran(compute=some(overruns, 0.95))
    environment = {"rehearsal": {"lateness_max": 5000.0}}
    assert judge(timing, MS, **counts, stalls=1, environment=environment).verdict == expected


@pytest.mark.parametrize("computed, expected", [(3.0, Verdict.VOID), (3.1, Verdict.MISSED)])
def test_the_instructions_of_several_periods_are_the_codes(computed: float, expected: Verdict) -> None:
    timing, counts = ran(inside={500: 4.0})
    counted = {"usual": 1000, "usual_ns": 50_000, "overruns": [10, round(computed * 20_000)]}
    environment = {"rehearsal": {"lateness_max": 5000.0}, "instructions": counted}
    assert judge(timing, MS, **counts, stalls=1, environment=environment).verdict == expected


@pytest.mark.parametrize("inside, expected", [(15.5, Verdict.VOID), (16.0, Verdict.MISSED)])
@pytest.mark.parametrize("held", [{"waits": {200: 5.0}}, {"waits": {200: 2.0}, "taken": {300: 5.0}}])
def test_the_longest_stall_is_that_of_waiting_or_of_the_scheduler(
    held: dict[str, Any], inside: float, expected: Verdict
) -> None:
    """A period of 1 ms and three times 5 ms are 16 ms; beside what is inside, a sample takes 0.16 ms."""
    assert verdict(inside={500: inside}, **held) == expected


def test_a_stall_counts_that_would_have_made_a_usual_sample_late() -> None:
    """Of 0.81 ms: stalls of 0.4 ms while the loop waits are such, and explain those of 0.5 ms in the code."""
    waits, inside = dict.fromkeys(range(10, N, 100), 0.4), dict.fromkeys(range(60, N, 250), 0.5)
    assert verdict(compute=0.7, waits=waits, inside=inside) == Verdict.VOID


def test_a_slow_first_sample_is_not_what_the_run_is_blamed_for() -> None:
    first = np.full(N, 0.05)
    first[0] = 1.2
    assert verdict(compute=first, waits={500: 50.0}, again=lambda which: first * MS) == Verdict.VOID


def test_a_sample_that_is_complete_when_the_next_is_due_is_in_time() -> None:
    none = Timing(np.arange(3), *np.zeros((6, 3)))
    for stage in ("lateness", "io", "interpolate", "compute", "model"):
        timing = replace(none, **{stage: np.array([0, MS, MS + 1])})
        assert late_samples(timing, MS).tolist() == [False, False, True], stage


def test_a_run_without_a_sample_has_a_verdict_and_a_summary() -> None:
    nothing = Timing(np.zeros(0, dtype=int), *np.zeros((6, 0)))
    assert judge(nothing, MS, discarded=5).verdict == Verdict.VOID
    assert summary(nothing, MS)["samples"] == 0 and "io" not in summary(nothing, MS)


def test_the_sentences_of_a_busy_computer_say_its_numbers() -> None:
    timing, counts = ran(waits={500: 8.0}, taken={700: 50.0, 800: 1.0})
    throttled = {"scheduler": "SCHED_FIFO 80", "rt_runtime_us": 950_000, "rt_period_us": 1_000_000}
    judgement = judge(timing, MS, **counts, missing=1, environment=throttled)
    assert judgement.evidence.startswith(
        "the system woke the loop up to 8.00 ms late with a period of 1 ms, took 51.00 ms from the running code, "
        "and kept I/O waiting up to 0.10 ms, 1 answer did not come within the period; it held the loop up for about"
    )
    timing, counts = ran(waits={500: 1.0}, discard=True)
    assert judge(timing, MS, **counts).reason.startswith("the computer was busy (0 of 999 samples late, 1 period disc")
    timing, counts = ran(waits={500: 2.0}, discard=True)
    assert "(0 of 998 samples late, 2 periods discarded)" in judge(timing, MS, **counts).reason


def test_the_sentences_of_slow_code_say_how_slow_and_whose() -> None:
    timing, counts = ran(compute=some(5, 4.0))
    judgement = judge(timing, MS, **counts)
    assert judgement.reason.startswith("control() and the model took 4.010 ms at most, of a sample period of 1 ms (")
    assert judge(timing, MS, **counts, limit=20).late_without_system == 0
    often = some(50, 2.0)
    often[500] = 9.0
    assert "took 2.010 ms at the 99th percentile" in judge(ran(compute=often)[0], MS).reason
    timing, counts = ran(compute=1.99)
    shared = replace(timing, interpolate=1.5 * timing.compute / 1.99, compute=0.49 * timing.compute / 1.99)
    assert judge(shared, MS, **counts).reason.startswith(
        "the interpolator (75% of it), control() and the model took 2.000 ms at the 99th percentile"
    )
    timing, counts = ran(waits=dict.fromkeys(range(10, N, 100), 5.0))
    assert "left 1 thread running" in judge(timing, MS, **counts, threads=1).reason


def test_the_summary_has_the_percentiles_of_each_stage() -> None:
    timing, _ = ran(samples=1001)
    told = summary(replace(timing, io=np.arange(1001) * 1e3, interpolate=np.eye(1, 1001)[0], model=np.zeros(1001)), MS)
    assert [told["io"][key] for key in ("p50", "p99", "p999", "max")] == pytest.approx([500.0, 990.0, 999.0, 1000.0])
    assert told["model"]["max"] == 0.0 and told["interpolate"]["max"] == 0.001
