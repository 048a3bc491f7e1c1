"""Answers that are late, lost, doubled or overtake each other are no other module's; another module's are noticed."""

from __future__ import annotations

import time

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.drivers import AxisDrivers
from rds.bus.modules.rds.frames import Answer, Kind, Status
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
