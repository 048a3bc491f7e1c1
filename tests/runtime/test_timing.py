"""Verdicts from times alone: whose fault a late sample is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import booleans, dictionaries, floats, integers
from made_timings import MS, N, ran, some, verdict

from rds.core.clock import LatePolicy, RealTimeClock
from rds.core.types import Ending, Verdict
from rds.modes.loop.loop import Loop
from rds.modes.loop.stopwatch import Stopwatch
from rds.modes.process.timing import judge, late_samples, longest_run, own_wait, replay, summary

SLOW = np.full(N, 2.0)


@pytest.mark.parametrize("discard", [False, True])
class TestWhoseFault:
    def test_in_time(self, discard: bool) -> None:
        assert verdict(discard=discard) == Verdict.MET
        assert verdict(compute=0.85, discard=discard) == Verdict.MET

    def test_a_slow_controller_missed(self, discard: bool) -> None:
        assert verdict(compute=SLOW, discard=discard) == Verdict.MISSED
        assert verdict(compute=1.05, discard=discard) == Verdict.MISSED

    def test_a_controller_that_is_slow_now_and_then_missed(self, discard: bool) -> None:
        assert verdict(compute=some(20, 1.5), discard=discard) == Verdict.MISSED

    def test_a_stalled_machine_is_void(self, discard: bool) -> None:
        stalls = {100: 50.0, 300: 50.0, 700: 50.0}
        assert verdict(waits=stalls, discard=discard) == Verdict.VOID

    def test_the_backlog_of_one_stall_is_not_blamed(self, discard: bool) -> None:
        assert verdict(compute=0.8, waits={100: 200.0}, discard=discard) == Verdict.VOID

    def test_a_slow_controller_on_a_stalled_machine_missed(self, discard: bool) -> None:
        stalls = dict.fromkeys(range(0, N, 100), 20.0)
        assert verdict(compute=SLOW, waits=stalls, discard=discard) == Verdict.MISSED
        assert verdict(compute=some(100, 1.5), waits=stalls, discard=discard) == Verdict.MISSED

    def test_what_the_scheduler_took_is_void(self, discard: bool) -> None:
        taken = dict.fromkeys(range(0, N, 50), 5.0)
        assert verdict(taken=taken, discard=discard) == Verdict.VOID

    def test_stalls_inside_the_code_of_a_stalling_machine_are_void(self, discard: bool) -> None:
        """Where waiting stalls as well, stalls while computing need no other cause."""
        waits = dict.fromkeys(range(10, N, 100), 5.0)
        inside = dict.fromkeys(range(60, N, 250), 5.0)
        assert verdict(waits=waits, inside=inside, discard=discard) == Verdict.VOID

    def test_doubtful_overruns_are_timed_again(self, discard: bool) -> None:
        """Alone they can't be told apart; called again, the student's code takes as long and the system's doesn't."""
        waits = dict.fromkeys(range(10, N, 100), 5.0)
        for compute, expected in ((some(5, 4.0), Verdict.MISSED), (0.05, Verdict.VOID)):
            inside = {} if expected is Verdict.MISSED else dict.fromkeys(range(60, N, 250), 4.0)
            timing, counts = ran(compute, waits, inside=inside, discard=discard)
            repeated = np.broadcast_to(np.asarray(compute, dtype=float), N)[timing.sample] * MS
            assert judge(timing, MS, **counts, again=lambda _, own=repeated: own).verdict == expected

    def test_a_single_overrun_is_timed_again(self, discard: bool) -> None:
        timing, counts = ran(inside={500: 3.0}, discard=discard)
        quick = np.full(len(timing.sample), 0.05 * MS)
        assert judge(timing, MS, **counts, again=lambda _: quick).verdict == Verdict.VOID
        assert judge(timing, MS, **counts, again=lambda _: timing.compute).verdict == Verdict.MISSED
        assert judge(timing, MS, **counts, again=lambda _: None).verdict == Verdict.MISSED
        assert judge(timing, MS, **counts, stalls=1).verdict == Verdict.VOID

    def test_a_slow_bus_missed_and_is_named(self, discard: bool) -> None:
        timing, counts = ran(io=1.5, discard=discard)
        judgement = judge(timing, MS, **counts)
        assert judgement.verdict == Verdict.MISSED
        assert judgement.reason.startswith("the bus's I/O took 1.500 ms at best, of a sample period of 1 ms (")
        timing, counts = ran(compute=2.0, io=1.5, discard=discard)
        both = "control() and the model took 2.010 ms at the 99th percentile, and the bus's I/O took 1.500 ms at best"
        assert judge(timing, MS, **counts).reason.startswith(both)

    def test_a_bus_that_leaves_no_time_to_compute_missed_and_is_named(self, discard: bool) -> None:
        """The controller was named alone, with its twentieth of the period."""
        timing, counts = ran(io=0.97, discard=discard)
        judgement = judge(timing, MS, **counts)
        assert judgement.verdict == Verdict.MISSED
        assert "the bus's I/O took 0.970 ms at best, and control() and the model took 0.060 ms" in judgement.reason

    @pytest.mark.parametrize("first", [0, 1, 7, 20, 800])
    def test_a_module_that_falls_silent_is_not_the_loops_fault(self, discard: bool, first: int) -> None:
        """Its answers are waited for until the period is over. In a short run that was the median of all I/O."""
        io = np.r_[np.full(first, 0.1), np.full(100, 1.0)]
        timing, counts = ran(io=io, samples=len(io), discard=discard)
        silent = int((timing.io >= MS).sum())
        judgement = judge(timing, MS, **counts, missing=silent + 1, silent=silent)
        assert judgement.verdict == Verdict.VOID
        assert "a module of the machine did not answer in time (" in judgement.reason
        assert judgement.evidence == f"the loop waited for a silent module in {silent} periods"
        slow, counts = ran(compute=2.0, io=io, samples=len(io), discard=discard)
        silent = int((slow.io >= MS).sum())
        assert judge(slow, MS, **counts, missing=silent, silent=silent).verdict == Verdict.MISSED

    def test_a_slow_bus_missed_although_a_module_falls_silent(self, discard: bool) -> None:
        timing, counts = ran(io=1.5, discard=discard)
        judgement = judge(timing, MS, **counts, missing=100, silent=100)
        assert judgement.verdict == Verdict.MISSED and "the bus's I/O took 1.500 ms" in judgement.reason

    def test_an_exchange_that_waits_now_and_then_is_void(self, discard: bool) -> None:
        io = np.full(N, 0.1)
        io[50::100] = 2.5
        timing, counts = ran(io=io, discard=discard)
        judgement = judge(timing, MS, **counts)
        assert judgement.verdict == Verdict.VOID and judgement.reason.endswith("on a quieter computer")

    def test_a_busy_computer_that_holds_up_the_buss_programs_is_void(self, discard: bool) -> None:
        """Without real-time priority on two busy cores: 0.2 ms at best, 3 ms at the median."""
        io = np.r_[np.full(N // 100 + 1, 0.2), np.full(N - N // 100 - 1, 3.0)]
        timing, counts = ran(compute=0.3, io=io, discard=discard)
        judgement = judge(timing, MS, **counts)
        assert judgement.verdict == Verdict.VOID
        assert "(3.00 ms at the median, 0.20 ms at best)" in judgement.evidence
        assert judgement.reason.endswith("on a quieter computer, or with a longer period")
        assert verdict(compute=0.9, io=io, discard=discard) == Verdict.MISSED


def test_without_doubt_nothing_is_called_again() -> None:
    def never(_: object) -> None:
        raise AssertionError

    for arguments in ({}, {"compute": SLOW}, {"waits": {100: 50.0}}, {"io": 2.0}):
        timing, counts = ran(**arguments)
        judge(timing, MS, **counts, again=never)


def test_code_that_starts_threads_is_not_called_again() -> None:
    def never(_: object) -> None:
        raise AssertionError

    timing, counts = ran(inside={500: 3.0})
    assert judge(timing, MS, **counts, threads=1, again=never).verdict == Verdict.MISSED


def test_a_stall_seen_by_the_rehearsal_counts() -> None:
    assert verdict(compute=some(5, 2.0), stalls=5) == Verdict.VOID
    assert verdict(compute=some(50, 2.0), stalls=5) == Verdict.MISSED


@pytest.mark.parametrize(
    "longest, stolen, inside, expected",
    [
        (600, 0, 2.85, Verdict.MISSED),
        (700, 0, 2.85, Verdict.VOID),
        (600, 1, 32.5, Verdict.VOID),
        (600, 1, 32.7, Verdict.MISSED),
    ],
)
def test_an_overrun_beyond_three_times_the_longest_stall_is_the_codes(
    longest: float, stolen: int, inside: float, expected: Verdict
) -> None:
    """2.85 and what a sample takes are 3.01 ms: a period of 1 ms, and more than three times 0.6 ms, but not 0.7 ms.

    With a clock tick of 10 ms that the hypervisor took, the bound is 32.8 ms.
    """
    timing, counts = ran(inside={500: inside})
    environment = {"rehearsal": {"lateness_max": longest}, "stolen_ticks": stolen}
    assert judge(timing, MS, **counts, stalls=1, environment=environment).verdict == expected


def test_discarded_periods_count_where_a_module_fell_silent() -> None:
    """Of 50 periods that were not kept, a module must have been silent in half to be what held them up."""
    timing, counts = ran(waits={500: 50.0}, discard=True)
    assert counts["discarded"] == 50
    for silent, who in ((9, "the computer"), (24, "the computer"), (25, "a module")):
        judgement = judge(timing, MS, **counts, silent=silent)
        assert judgement.verdict == Verdict.VOID and judgement.reason.startswith(who)
    timing, counts = ran(waits={500: 16.0}, discard=True)
    for silent, who in ((8, "the computer"), (9, "a module")):
        assert judge(timing, MS, **counts, silent=silent).reason.startswith(who), "ten in a row end a run"


def test_threads_that_the_code_left_running_are_its_own() -> None:
    waits = dict.fromkeys(range(10, N, 100), 5.0)
    timing, counts = ran(waits=waits)
    judgement = judge(timing, MS, **counts, threads=2)
    assert judgement.verdict == Verdict.MISSED
    assert "left 2 threads running" in judgement.reason
    assert judge(timing, MS, **counts, threads=2, stalls=3).verdict == Verdict.VOID
    assert verdict(threads=2) == Verdict.MET


def test_the_limit_allows_so_many() -> None:
    compute = some(20, 1.5)
    assert verdict(compute=compute, limit=20) == Verdict.MET
    assert verdict(compute=compute, limit=19) == Verdict.MISSED
    assert verdict(waits={100: 1.5}, limit=5) == Verdict.MET
    assert verdict(compute=some(4, 1.5), waits={150: 60.0}, limit=5) == Verdict.VOID


def test_discarded_periods_are_not_met() -> None:
    """The sample after them is in time again, so nothing else shows them; at the end, not even a sample."""
    timing, counts = ran(waits={500: 50.0}, discard=True)
    assert not late_samples(timing, MS).any()
    assert judge(timing, MS, **counts).verdict == Verdict.VOID
    assert own_wait(timing, MS).max() == pytest.approx(50.0 * MS)
    timing, counts = ran(waits={990: 50.0}, discard=True)
    assert counts["discarded"] == 10
    assert judge(timing, MS, **counts).verdict == Verdict.VOID


def test_the_first_sample_is_exempt_but_not_what_it_delays() -> None:
    first = np.full(N, 0.05)
    first[0] = 1.2
    assert verdict(compute=first) == Verdict.MET
    first[0] = 50.0
    assert verdict(compute=first) == Verdict.MISSED


def test_reasons_say_what_and_how_much() -> None:
    timing, counts = ran(compute=SLOW)
    judgement = judge(timing, MS, **counts)
    assert judgement.reason == (
        "control() and the model took 2.010 ms at the 99th percentile, of a sample period of 1 ms "
        "(999 of 1000 samples late)"
    )
    assert judgement.evidence == "999 samples would have been late on a computer without delays of its own"
    timing, counts = ran(waits={500: 50.0})
    judgement = judge(timing, MS, **counts)
    assert "woke the loop up to 50.00 ms late" in judgement.evidence and "answer" not in judgement.evidence
    assert judgement.reason.startswith("the computer was busy (")
    assert judgement.reason.endswith("says nothing about your code. Repeat it on a quieter computer")
    assert judgement.to_json()["verdict"] == "void"
    judgement = judge(timing, MS, **counts, missing=20)
    assert judgement.reason.startswith("the computer or the bus was busy")
    assert "20 answers did not come within the period" in judgement.evidence
    throttled = {"scheduler": "SCHED_FIFO 80", "rt_runtime_us": 950_000, "rt_period_us": 1_000_000}
    assert "for about the 50 ms of each second" in judge(timing, MS, **counts, environment=throttled).evidence
    timing, counts = ran(compute=0.95)  # with the I/O it is too much in every sample
    assert "took 0.960 ms at the 99th percentile" in judge(timing, MS, **counts).reason
    timing, counts = ran(waits={500: 1.0})
    assert "within the limit of 9" in judge(timing, MS, limit=9).reason
    assert "all 1000 samples" in judge(ran()[0], MS).reason


@settings(max_examples=150, deadline=None)
@given(
    waits=dictionaries(integers(0, 299), floats(0.0, 80.0), max_size=20),
    taken=dictionaries(integers(0, 299), floats(0.0, 20.0), max_size=20),
    stalled_io=dictionaries(integers(0, 299), floats(0.0, 20.0), max_size=20),
    compute=floats(0.0, 0.85),
    discard=booleans(),
)
def test_nobody_is_blamed_whose_own_times_fit(
    waits: dict[int, float], taken: dict[int, float], stalled_io: dict[int, float], compute: float, discard: bool
) -> None:
    io = np.full(300, 0.1)
    for k, ms in stalled_io.items():
        io[k] += ms
    assert verdict(compute, waits, io, taken=taken, samples=300, discard=discard) != Verdict.MISSED


@settings(max_examples=150, deadline=None)
@given(
    waits=dictionaries(integers(0, 299), floats(0.0, 80.0), max_size=20),
    taken=dictionaries(integers(0, 299), floats(0.0, 20.0), max_size=20),
    compute=floats(1.05, 20.0),
    discard=booleans(),
)
def test_who_never_fits_is_blamed_on_any_machine(
    waits: dict[int, float], taken: dict[int, float], compute: float, discard: bool
) -> None:
    if discard:
        waits = {k: min(ms, 5.0) for k, ms in waits.items()}  # else hardly a sample may be left
    assert verdict(compute, waits, taken=taken, samples=300, discard=discard) == Verdict.MISSED


@given(waits=dictionaries(integers(1, 99), floats(0.0, 20.0), max_size=20), discard=booleans())
def test_waits_are_found_where_they_were(waits: dict[int, float], discard: bool) -> None:
    timing, _ = ran(waits=waits, samples=100, discard=discard)
    found = own_wait(timing, MS)
    if not discard:
        assert found == pytest.approx([waits.get(k, 0.0) * MS for k in range(100)], abs=1.0)
    assert (found >= 0).all()


def test_the_replay_by_hand() -> None:
    work = np.array([0.5, 2.5, 0.5, 0.5, 0.5, 0.5]) * MS
    assert replay(work, np.arange(6), MS).tolist() == [False, True, True, True, False, False]
    assert replay(work, np.array([0, 1, 4, 5, 6, 7]), MS).tolist() == [False, True, False, False, False, False]


def test_the_models_live_through_periods_that_the_loop_discards() -> None:
    """Of 8 samples 1 to 3 and the last two are discarded; what was asked for in between is kept."""
    followed: list[object] = []
    rows: list[list[float]] = []

    def law(k: int, positions: Sequence[float], row: list[float], voltages: list[float]) -> None:
        assert k < 100
        row.append(10.0 * k)
        voltages.append(k + positions[0])

    def follow(acting: Sequence[float]) -> Sequence[float]:
        followed.append(tuple(acting))
        return [-1.0]

    due = {0: 0, 1: 4, 5: 5, 6: 9}
    loop = Loop(8, due.__getitem__, lambda: [0.5], [law], lambda v: [2 * v[0]], follow, rows.append, lambda k: None)
    assert loop.run(1) is None and loop.k == 1
    assert loop.run() is Ending.DONE and loop.k == 6
    assert rows == [[0, 0.0, 1.0, -1.0], [4, 40.0, 9.0, -1.0], [5, 50.0, 11.0, -1.0]]
    assert followed == [(1.0,), (), (), (), (9.0,), (11.0,), (), ()]
    ended = replace(loop, k=5, finish=lambda k: Ending.STOPPED if k == 5 else None)
    assert ended.run() is Ending.STOPPED and ended.k == 6
    ended.k, ended.samples, ended.wait = 100, 200, lambda k: k
    with pytest.raises(AssertionError):
        ended.run()
    assert ended.k == 100, "the sample that failed"


@pytest.mark.parametrize("sets_references, stages", [(True, (2, 4)), (False, (0, 6))])
def test_each_stage_has_its_own_time(sets_references: bool, stages: tuple[int, int]) -> None:
    """Stages of 1, 2, 4, 8 and 16 µs, begun 32 µs after the sample is due; 3 µs are taken from the code."""
    clock, at, spans, counted = RealTimeClock(MS, LatePolicy(stop_after=1)), [0], [], []

    def taking(micros: int, *gives: float, late: int = 0) -> Callable[..., Any]:
        def stage(k: object = None, *_: object) -> Any:
            at[0] += 1000 * (micros + (late if k == 2 else 0))
            return list(gives)

        return stage

    def wait(k: int) -> int:
        at[0] = (k + 1) * MS + 32_000  # sample 0 is due one period after the start
        return k

    clock.now, clock.wait = (lambda: at[0]), wait  # type: ignore[method-assign]
    clock.start()
    rows: list[list[float]] = []
    stopwatch = Stopwatch(clock, rows.append, lambda: False)
    stopwatch.thread.taken = lambda span: spans.append(span) or 3000  # type: ignore[method-assign, func-returns-value]
    stopwatch.instructions.end = counted.append  # type: ignore[method-assign]
    laws = [taking(2), taking(4, late=1000)]
    parts = (taking(1, 0.0), laws, taking(8, 0.5), taking(16, 0.7), rows.append, lambda k: None)
    loop = Loop(9, wait, *parts, sets_references=sets_references)
    ending = stopwatch.time(loop).run()
    stopwatch.close()
    assert rows[:2] == [[k, 32_000, 9000, stages[0] * 1000, stages[1] * 1000, 16_000, 3000, 0.5, 0.7] for k in (0, 1)]
    assert spans[0] == 30_000 and counted[0] == 30_000 - 3000 - 8000
    assert (ending, len(rows)) == (Ending.OVERLOADED, 3)
    stopped = Stopwatch(clock, rows.append, lambda: True)
    assert (stopped.time(loop).run(), len(rows)) == (Ending.STOPPED, 4)
    stopped.close()


def test_the_summary_counts_and_sorts() -> None:
    timing, _ = ran(compute=some(10, 3.0))
    report = summary(timing, MS)
    assert report["samples"] == N
    assert report["compute"]["p50"] == pytest.approx(50.0)
    assert report["compute"]["max"] == pytest.approx(3000.0)
    assert sum(report["compute"]["histogram"]) == N
    assert len(report["compute"]["histogram"]) == len(report["histogram_edges_us"])
    assert report["lateness"]["p50"] == 0.0 and "interpolate" not in report, "there was no path"
    along = replace(timing, interpolate=np.full(N, 20_000.0))
    assert summary(along, MS)["interpolate"]["p99"] == pytest.approx(20.0)
    assert report["late"] == int(late_samples(timing, MS).sum())
    assert report["longest_late_run"] == 3
    assert longest_run(np.array([], dtype=bool)) == 0
    assert longest_run(np.array([True, True, False, True])) == 2
