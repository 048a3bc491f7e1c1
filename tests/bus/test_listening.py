"""Whoever listens to a bus while the computer is held up has not heard silence."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import can
import pytest

from rds.bus import estop, frames, listening
from rds.bus.frames import Status


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


def test_the_emergency_stop_of_a_host_that_is_held_up_hears_who_acknowledged(
    clock: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It said that no module is there, and that nothing moves."""
    monkeypatch.setattr(estop, "stop_oacs", lambda bus: [])
    monkeypatch.setattr(estop.drives, "cut", lambda bus: {})
    answer = frames.encode_answer(frames.Answer(0, Status.EMERGENCY, frames.Kind.REPORT, 0))
    bus = clock(Bus(iter([(0.3, None), (0.0, frame(frames.answer_identifier(2), answer))])))
    assert estop.stop_everything(bus) == [2]
