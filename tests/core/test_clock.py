"""The real-time clock on a time of its own: due times, late modes, and the end after too many late samples."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis.strategies import booleans, integers, lists

import rds.core.clock
from rds.core.clock import LatePolicy, RealTimeClock

MS = 1_000_000


class Time:
    """A time that passes when somebody sleeps or looks at it."""

    LOOK = 100  # ns that a look takes

    def __init__(self) -> None:
        self.ns = 5_000_000_000
        self.slept: list[float] = []

    def perf_counter_ns(self) -> int:
        self.ns += self.LOOK
        return self.ns

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.ns += round(seconds * 1e9)


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> Iterator[Time]:
    time = Time()
    monkeypatch.setattr(rds.core.clock, "time", time)
    yield time


def run(time: Time, work_ms: dict[int, float], policy: LatePolicy, samples: int = 12) -> list[tuple[int, float]]:
    """The samples taken and when they began, ms after sample 0 was due; a sample works 0.1 ms unless it is told."""
    clock = RealTimeClock(MS, policy)
    clock.start()
    zero, k, taken = None, 0, []
    while k < samples:
        k = clock.wait(k)
        if zero is None:
            zero = time.ns
        taken.append((k, round((time.ns - zero) / MS, 2)))
        time.ns += round(work_ms.get(k, 0.1) * MS)
        if clock.finish(k, time.ns):
            break
        k += 1
    return taken


def on_time(samples: list[int]) -> list[tuple[int, float]]:
    return [(k, float(k)) for k in samples]


def test_on_time_every_sample_begins_when_it_is_due(time: Time) -> None:
    assert run(time, {}, LatePolicy()) == on_time(list(range(12)))
    assert max(time.slept) < 1e-3
    assert len(time.slept) == 12


def test_process_and_keep_phase_catches_up(time: Time) -> None:
    assert run(time, {3: 3.5}, LatePolicy()) == [
        *on_time([0, 1, 2, 3]),
        (4, 6.5),
        (5, 6.6),
        (6, 6.7),
        *on_time([7, 8, 9, 10, 11]),
    ]


def test_discard_and_keep_phase_drops_whole_periods(time: Time) -> None:
    """Sample 6 is the last that was due when sample 3 ended at 6.5 ms."""
    assert run(time, {3: 3.5}, LatePolicy(discard=True)) == [
        *on_time([0, 1, 2, 3]),
        (6, 6.5),
        *on_time([7, 8, 9, 10, 11]),
    ]


def test_process_and_ignore_phase_starts_the_schedule_anew(time: Time) -> None:
    taken = run(time, {3: 3.5}, LatePolicy(keep_phase=False))
    assert taken == [*on_time([0, 1, 2, 3]), *((k, k + 2.5) for k in range(4, 12))]


def test_discard_and_ignore_phase_does_both(time: Time) -> None:
    taken = run(time, {3: 3.5}, LatePolicy(discard=True, keep_phase=False))
    assert taken == [*on_time([0, 1, 2, 3]), *((k, k + 0.5) for k in range(6, 12))]


def test_less_than_a_period_late_discards_nothing(time: Time) -> None:
    taken = run(time, {3: 1.5}, LatePolicy(discard=True))
    assert taken == [*on_time([0, 1, 2, 3]), (4, 4.5), *on_time(list(range(5, 12)))]


def test_the_run_stops_after_so_many_late_samples_in_a_row(time: Time) -> None:
    slow = dict.fromkeys([2, 4, 5, 6, 7], 1.5) | dict.fromkeys([3, 8, 9, 10], 0.1)
    assert [k for k, _ in run(time, slow, LatePolicy(stop_after=3))][-1] == 6
    assert [k for k, _ in run(time, slow, LatePolicy())][-1] == 11


def test_the_first_sample_may_be_late(time: Time) -> None:
    policy = LatePolicy(stop_after=1)
    assert [k for k, _ in run(time, {0: 1.5}, policy)][-1] == 11
    assert [k for k, _ in run(time, {1: 1.5}, policy)][-1] == 1


@given(
    work=lists(integers(0, 5000), min_size=12, max_size=12),
    discard=booleans(),
    keep_phase=booleans(),
)
def test_order_and_phase_hold_whatever_samples_take(work: list[int], discard: bool, keep_phase: bool) -> None:
    with pytest.MonkeyPatch.context() as patch:
        time = Time()
        patch.setattr(rds.core.clock, "time", time)
        taken = run(time, {k: us / 1e3 for k, us in enumerate(work)}, LatePolicy(discard, keep_phase))
    numbers = [k for k, _ in taken]
    assert numbers == sorted(set(numbers))
    if not discard:
        assert numbers == list(range(12))
    for k, at in taken:
        assert at >= k - 0.01  # never before it is due
    if keep_phase and discard:
        assert all(at - k <= max(work) / 1e3 + 0.02 for k, at in taken)


def test_a_real_clock_keeps_its_due_times() -> None:
    """On any machine: no sample before it is due."""
    clock = RealTimeClock(MS)
    clock.start()
    for k in range(20):
        clock.wait(k)
        assert clock.lateness(k, clock.now()) >= 0
