"""Answers that are late, lost, doubled or overtake each other are no other module's; another module's are noticed."""

from __future__ import annotations

import time

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.answer_order import DUPLICATES, PERSISTENT, SUSPECTED, AnswerOrder, AnswerPosition
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.bus.modules.rds.frames import COUNT_TURNS, Answer, Kind, Status
from rds.core.errors import MachineError
from rds.machines import load_machine

MACHINE = load_machine("mini-cnc")
PERIOD = 1e-3


class Line(can.BusABC):
    """A bus with one set-up module, X, that answers each tick so many ticks later, so many times."""

    def __init__(self, ticks: int = 0) -> None:
        self.ticks = ticks  # heard by the module
        self.counts = 0
        self.speed = 0  # counts per tick
        self.mute = False
        self.deaf = 0  # to so many ticks
        self.faults: list[tuple[int, int]] = []  # of the next answers: delay in ticks, copies
        self._now = 0
        self._under_way: list[tuple[int, can.Message]] = []
        self._inbox: list[can.Message] = []
        super().__init__("line")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.arbitration_id != frames.COMMAND:
            return
        self._now += 1
        self.counts += self.speed
        if self.deaf:
            self.deaf -= 1
            return
        self.ticks += 1
        delay, copies = self.faults.pop(0) if self.faults else (0, 1)
        data = frames.encode_answer(Answer(self.counts, Status.ENABLED, Kind.ANSWER, self.ticks))
        message = can.Message(arbitration_id=0x22, is_extended_id=False, data=data)
        self._under_way += [(self._now + delay, message)] * (0 if self.mute else copies)
        self._inbox += [frame for due, frame in self._under_way if due <= self._now]
        self._under_way = [entry for entry in self._under_way if entry[0] > self._now]

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self._inbox:
            return self._inbox.pop(0), False
        time.sleep(timeout or 0.0)
        return None, False


def started(ticks: int = 0) -> tuple[Line, AxisDrivers]:
    line = Line(ticks)
    drivers = AxisDrivers(MACHINE, ["X"], bus=line, sample_period=PERIOD)
    drivers.start()
    line.speed = 1
    return line, drivers


def counts(drivers: AxisDrivers) -> int:
    return round(drivers.exchange()[0] / MACHINE.axis("X").resolution)


FAULTS = st.lists(st.tuples(st.integers(0, 40) | st.just(2), st.integers(0, 2)), max_size=40)


@settings(max_examples=25, deadline=None)
@given(FAULTS, st.sampled_from([0, 65480]))
def test_no_order_of_a_modules_own_answers_ends_a_run(faults: list[tuple[int, int]], ticks: int) -> None:
    line, drivers = started(ticks)
    with line:
        line.faults = list(faults)
        seen = [counts(drivers) for _ in range(len(faults) + 45)]
        assert seen == sorted(seen), "no older position after a newer one"
        assert all(position <= k for k, position in enumerate(seen, 1))
        assert counts(drivers) == line.counts, "in step again"
        before = drivers.counters.missing, drivers.counters.late
        assert [counts(drivers) for _ in range(5)] == list(range(line.counts - 4, line.counts + 1))
        assert (drivers.counters.missing, drivers.counters.late) == before


def test_answers_two_periods_late_then_prompt_ones() -> None:
    line, drivers = started()
    with line:
        line.faults = [(2, 1)] * 20
        for _ in range(30):
            drivers.exchange()
        assert counts(drivers) == line.counts
        assert drivers.counters.late >= 2 and drivers.counters.lost_ticks == 0


def test_a_tick_that_the_module_lost_is_counted_and_no_answer_is_late_for_ever() -> None:
    line, drivers = started()
    with line:
        line.deaf = 3
        for _ in range(6):
            drivers.exchange()
        assert counts(drivers) == line.counts
        assert drivers.counters.lost_ticks == 3


@pytest.mark.parametrize("elsewhere", [0, 5, -15, 1000, 40000])
def test_a_set_up_module_in_the_place_of_another_ends_the_run_within_ten_answers(elsewhere: int) -> None:
    line, drivers = started(100)
    with line:
        for _ in range(20):
            drivers.exchange()
        here = drivers.exchange()
        line.ticks = elsewhere if elsewhere >= 0 else line.ticks + elsewhere
        line.counts = 7777
        with pytest.raises(MachineError, match="has restarted, or was replaced"):
            for _ in range(10):
                assert drivers.exchange() == here, "its position is not taken"


def test_a_module_in_the_place_of_another_that_falls_silent_is_still_named() -> None:
    line, drivers = started(100)
    with line:
        drivers.exchange()
        line.ticks = 1000
        for _ in range(5):
            drivers.exchange()
        line.mute = True
        with pytest.raises(MachineError, match="has restarted, or was replaced"):
            for _ in range(120):
                drivers.exchange()


# --- the order itself, answer by answer


def answer(ticks: int) -> Answer:
    return Answer(0, Status.ENABLED, Kind.ANSWER, ticks % COUNT_TURNS)


def in_step(at: int, ticks: int = 0) -> AnswerOrder:
    """The answer to tick `at` was taken, and so many more are sent."""
    order = AnswerOrder()
    order.tick()
    assert order.place(answer(at)) == AnswerPosition.LAST and order.take(answer(at)) == 0, "the first may say any count"
    for _ in range(ticks):
        order.tick()
    return order


@pytest.mark.parametrize("at", [0, 1000, COUNT_TURNS - 2, COUNT_TURNS - 66])
@pytest.mark.parametrize("ticks", [1, 3])
def test_what_follows_is_new_and_at_most_some_duplicates_ahead(at: int, ticks: int) -> None:
    most = ticks + DUPLICATES
    for further, place in ((0, "ASTRAY"), (1, "LAST"), (ticks, "LAST"), (most, "LAST"), (most + 1, "ASTRAY")):
        assert in_step(at, ticks).place(answer(at + further)) == AnswerPosition[place]
    assert in_step(at).place(answer(at)) == AnswerPosition.ASTRAY, "it comes twice, and no tick was sent meanwhile"


@pytest.mark.parametrize("ticks", [1, 2])
def test_one_that_follows_the_last_taken_shows_that_the_module_is_there(ticks: int) -> None:
    """Be it the answer to the last tick or to the one before."""
    order = in_step(1000, ticks)
    for k in range(PERSISTENT - 1):
        order.place(answer(30_000 + k))
    assert order.place(answer(1001)) == AnswerPosition.LAST
    for k in range(SUSPECTED):
        assert not order.is_another(silent=True)
        order.place(answer(30_000 + PERSISTENT - 1 + k))
    assert order.is_another(silent=True) and not order.is_another()


@pytest.mark.parametrize("step, is_one", [(1, True), (DUPLICATES, True), (DUPLICATES + 1, False)])
def test_answers_astray_that_follow_one_another_are_another_modules(step: int, is_one: bool) -> None:
    order = in_step(1000, 1)
    for k in range(1, PERSISTENT + 1):
        for _ in range(2):  # one that comes twice says nothing
            assert order.place(answer(30_000 + k * step)) == AnswerPosition.ASTRAY
        assert order.is_another() == (is_one and k >= PERSISTENT)
        assert order.is_another(silent=True) == (is_one and k >= SUSPECTED)
    assert order.place(answer(1001)) == AnswerPosition.LAST and not order.is_another(silent=True), "it is still there"
    for k in range(2):
        order.place(answer(30_000 + k))
    assert not order.is_another(silent=True), "they are counted anew"
    order.take(answer(1001))
    order.place(answer(30_002))
    assert not order.is_another(silent=True)


def test_a_doubtful_answer_is_of_a_slow_module_or_of_one_that_lost_a_tick() -> None:
    """The answer to tick 1001 came where that to 1002 was due; what comes next tells which it was."""

    def doubtful() -> AnswerOrder:
        order = in_step(1000, 2)
        assert order.place(answer(1001)) == AnswerPosition.LAST
        order.take_doubtful(answer(1001))
        assert (order.expected, order.behind, order.owed) == (1001, 1, 1)
        return order

    lost = doubtful()
    lost.tick()
    assert lost.place(answer(1002)) == AnswerPosition.LAST and lost.take(answer(1002)) == 1
    slow = doubtful()
    slow.tick()
    slow.tick()  # 1003 in its count, 1004 in the host's
    assert slow.place(answer(1002)) == AnswerPosition.EARLIER and slow.owed == 0
    assert slow.place(answer(1003)) == AnswerPosition.LAST
    assert slow.place(answer(1004)) == AnswerPosition.LAST and slow.take(answer(1004)) == 0
    for ticks, owed, gives, expected, behind in ((1001, 0, 0, 1001, 1), (1002, 0, 0, 1002, 0), (1003, 0, -1, 1003, 0)):
        between = doubtful()  # two periods
        assert between.straggler(answer(ticks)) == gives
        assert (between.owed, between.expected, between.behind) == (owed, expected, behind)
    still = doubtful()
    assert still.straggler(answer(1000)) == 0 and (still.owed, still.expected) == (1, 1001)
    still.tick()
    still.tick()
    still.take_doubtful(answer(1002))
    assert still.behind == 2, "ever further behind"
