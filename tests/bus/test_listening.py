"""Whoever listens to a bus while the computer is held up has not heard silence."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import can
import pytest

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Status
from rds.bus.tools import estop, listening, traffic
from rds.core.errors import MachineError


class Bus:
    """A bus with a clock of its own. `steps` says what each recv() does: (seconds that pass, frame or None)."""

    channel_info = "bus"

    def __init__(self, steps: Iterator[tuple[float | None, can.Message | None]]):
        self.now = 0.0
        self.steps = steps

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        pass

    def recv(self, timeout: float) -> can.Message | None:
        seconds, message = next(self.steps, (None, None))
        self.now += timeout if seconds is None else seconds
        return message


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Any:
    def of(bus: Bus) -> Bus:
        monkeypatch.setattr(listening, "time", SimpleNamespace(monotonic=lambda: bus.now))
        return bus

    return of


def frame(identifier: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=data)


def test_standing_still_is_no_time_of_silence(clock: Any) -> None:
    """Of 0.1 s the process stands still for 3 s at the begin, and for 3 s at the end: 0.1 s are heard all the same."""
    steps = [(3.0, None), *((None, None),) * 3, (0.001, frame(1)), (3.0, None), (0.0, frame(2))]
    bus = clock(Bus(iter(steps)))
    assert [message.arbitration_id for message in listening.frames_within(bus, 0.1)] == [1, 2]
    assert bus.now == pytest.approx(6.0 + 0.1 - 2 * 0.02, abs=0.02)


def test_frames_that_wait_at_the_end_were_heard(clock: Any) -> None:
    bus = clock(Bus(iter([*((None, None),) * 4, (3.0, None), (0.0, frame(1)), (0.0, frame(2))])))
    assert [message.arbitration_id for message in listening.frames_within(bus, 0.1)] == [1, 2]


def test_listening_to_one_who_babbles_ends(clock: Any) -> None:
    bus = clock(Bus(iter(lambda: (1e-5, frame(1)), None)))
    heard = sum(1 for _ in listening.frames_within(bus, 0.1))
    assert heard == pytest.approx(0.1 / 1e-5 + listening._MOST_WAITING, rel=0.01)


def test_a_listener_who_is_slower_than_one_who_babbles_ends_soon(clock: Any) -> None:
    """At 1 ms a frame, 20,000 frames took 20 s, and a scan listens several times."""
    bus = clock(Bus(iter(lambda: (1e-3, frame(1)), None)))
    assert sum(1 for _ in listening.frames_within(bus, 0.1)) == pytest.approx(600, abs=5)


def test_the_emergency_stop_of_a_host_that_is_held_up_hears_who_acknowledged(
    clock: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said that no module is there, and that nothing moves."""
    monkeypatch.setattr(estop, "stop_oacs", lambda bus: [])
    monkeypatch.setattr(estop.drives, "cut", lambda bus: {})
    answer = frames.encode_answer(frames.Answer(0, Status.EMERGENCY, frames.Kind.REPORT, 0))
    bus = clock(Bus(iter([(0.3, None), (0.0, frame(frames.answer_identifier(2), answer))])))
    assert estop.stop_everything(bus) == [2]


def test_a_pause_for_another_thread_does_not_count_standing_still(monkeypatch: pytest.MonkeyPatch) -> None:
    now, slept = 0.0, []

    def sleep(seconds: float) -> None:
        nonlocal now
        slept.append(seconds)
        now += seconds + (3.0 if len(slept) == 1 else 1e-4)  # a little late, as always

    monkeypatch.setattr(listening, "time", SimpleNamespace(monotonic=lambda: now, sleep=sleep))
    listening.pause(0.1)
    assert sum(slept) == pytest.approx(0.1, abs=2e-3)


def dense(every: float, seconds: float) -> list[can.Message]:
    """Frames of 8 bytes, 0.125 ms at 1 Mbit/s, sent each `every` s for so long."""
    return [
        can.Message(timestamp=every * k, arbitration_id=5, is_extended_id=False, data=b"UUUUUUUU")
        for k in range(round(seconds / every))
    ]


def test_a_babbler_is_heard_by_one_who_is_held_up(clock: Any) -> None:
    """Of 0.25 s the listener gets the first 0.12: less than half of the time, and all of it is taken."""
    bus = clock(Bus(iter([*((0.00014, message) for message in dense(0.00014, 0.12)), (5.0, None)])))
    bus.bitrate = 1_000_000
    with pytest.raises(MachineError, match="is taken"):
        traffic.refuse_taken(bus)


def test_what_has_piled_up_while_the_listener_stood_still_is_no_babble(clock: Any) -> None:
    """A fifth of the time is taken, for 3 s that are heard at once."""
    bus = clock(Bus(iter([(3.0, None), *((0.0, message) for message in dense(0.0006, 3.0))])))
    bus.bitrate = 1_000_000
    traffic.refuse_taken(bus)


def test_a_babbler_is_heard_by_one_who_reads_slowly(clock: Any) -> None:
    """In 0.75 s it reads 75 of the 6000 frames, which were sent within 0.01 s."""
    bus = clock(Bus(iter((0.01, message) for message in dense(0.00014, 0.84))))
    bus.bitrate = 1_000_000
    with pytest.raises(MachineError, match=r"is taken; \d\d frames in 0\.01 s"):
        traffic.refuse_taken(bus)
