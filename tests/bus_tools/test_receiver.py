"""Whatever recv() or a subscriber raises, either the receiver goes on or on_error was called."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from waiting import wait_for

from rds.bus.tools import receiver as module
from rds.bus.tools.receiver import Fault, ReceiveFault, Receiver

RAISES: list[Callable[[], BaseException]] = [
    lambda: can.CanOperationError("bus error"),
    lambda: can.CanTimeoutError("late"),
    lambda: OSError(5, "input/output error"),
    lambda: ValueError("garbage"),
    lambda: MemoryError(),
    lambda: RuntimeError(),
    lambda: StopIteration(),
    lambda: SystemExit(3),
    lambda: KeyboardInterrupt(),
    lambda: GeneratorExit(),
]


class FakeBus:
    """Gives what its script says: a message, None, or an exception; then None for ever."""

    def __init__(self, script: list[Any], state: can.BusState = can.BusState.ACTIVE):
        self.script = list(script)
        self.state = state
        self.shut_down = False

    def recv(self, timeout: float) -> can.Message | None:
        if not self.script:
            time.sleep(0.001)
            return None
        item = self.script.pop(0)
        if callable(item):
            raise item()
        return item

    def shutdown(self) -> None:
        self.shut_down = True


def numbered(k: int) -> can.Message:
    return can.Message(arbitration_id=1, is_extended_id=False, data=k.to_bytes(8, "little"))


def number(message: can.Message) -> int:
    return int.from_bytes(message.data, "little")


@contextmanager
def receiving(*buses: FakeBus, **options: Any) -> Iterator[tuple[Receiver, list[Fault]]]:
    """A receiver of one bus after the other."""
    left = list(buses)
    faults: list[Fault] = []
    receiver = Receiver(lambda: left.pop(0), faults.append, name="test bus", **options)
    try:
        yield receiver, faults
    finally:
        receiver.stop()


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times that a test can wait for."""
    monkeypatch.setattr(module, "FIRST_PAUSE", 0.001)
    monkeypatch.setattr(module, "LONGEST_PAUSE", 0.002)
    monkeypatch.setattr(module, "STEADY", 0.05)
    monkeypatch.setattr(module, "_LOOK", 0.01)


@pytest.mark.parametrize("make", RAISES, ids=lambda make: type(make()).__name__)
def test_it_goes_on_or_says_so(make: Callable[[], BaseException], caplog: pytest.LogCaptureFixture) -> None:
    error = make()
    first, second = FakeBus([numbered(1), make]), FakeBus([numbered(2)])
    with receiving(first, second) as (receiver, faults):
        frames = receiver.subscribe()
        receiver.start()
        assert number(frames.get(10.0)) == 1
        if isinstance(error, Exception):
            assert number(frames.get(10.0)) == 2
            assert receiver.alive()
        else:
            assert frames.get(10.0) is None
            wait_for(lambda: not receiver.alive())
    assert [fault.trouble for fault in faults] == [
        ReceiveFault.BUS if isinstance(error, Exception) else ReceiveFault.ENDED
    ]
    assert (str(error) or type(error).__name__) in faults[0].text
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR] == [faults[0].text]
    assert first.shut_down


@given(st.lists(st.one_of(st.integers(0, 255).map(numbered), st.none(), st.sampled_from(RAISES)), max_size=12))
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_frame_arrives_or_the_end_was_reported(script: list[Any]) -> None:
    bus = FakeBus(script)
    faults: list[Fault] = []
    receiver = Receiver(lambda: bus, faults.append)
    frames = receiver.subscribe()
    with receiver:
        wait_for(lambda: not bus.script or not receiver.alive())
        going_on = receiver.alive() and not any(fault.trouble is ReceiveFault.ENDED for fault in faults)
    seen = []
    while (message := frames.get(0.0)) is not None:
        seen.append(message)
    fatal = next((i for i, x in enumerate(script) if callable(x) and not isinstance(x(), Exception)), len(script))
    assert seen == [item for item in script[:fatal] if isinstance(item, can.Message)]
    assert going_on or [fault.trouble for fault in faults][-1] is ReceiveFault.ENDED


def test_an_outage_is_reported_once_and_its_end_too() -> None:
    recovered = threading.Event()
    broken = [FakeBus([RAISES[0]]) for _ in range(5)]
    with receiving(*broken, FakeBus([]), FakeBus([]), on_recovery=recovered.set) as (receiver, faults):
        receiver.start()
        assert recovered.wait(30.0)
        assert len(faults) == 1 and "test bus failed: bus error; it is opened again" in faults[0].text
        assert receiver.outages == 1
        receiver.bus.script.append(RAISES[2])  # type: ignore[union-attr]
        wait_for(lambda: len(faults) == 2)


def test_a_bus_that_cannot_be_opened_again_is_tried_until_it_can() -> None:
    attempts = 0

    def opener() -> Any:
        nonlocal attempts
        attempts += 1
        if attempts == 1:
            return FakeBus([RAISES[0]])
        if attempts < 8:
            raise can.CanInitializationError("still away")
        return FakeBus([numbered(7)])

    faults: list[Fault] = []
    receiver = Receiver(opener, faults.append)
    frames = receiver.subscribe()
    with receiver:
        assert number(frames.get(10.0)) == 7
    assert len(faults) == 1


def test_bus_off_is_reported_and_the_bus_opened_again() -> None:
    with receiving(FakeBus([], can.BusState.ERROR), FakeBus([numbered(1)])) as (receiver, faults):
        frames = receiver.subscribe()
        receiver.start()
        assert number(frames.get(10.0)) == 1
    assert [fault.trouble for fault in faults] == [ReceiveFault.BUS_OFF]


def test_without_reopening_the_first_failure_is_the_end() -> None:
    with receiving(FakeBus([RAISES[0]]), reopen=False) as (receiver, faults):
        receiver.start()
        wait_for(lambda: not receiver.alive())
        late = receiver.subscribe()
        assert late.ended
    assert "it is read no more" in faults[0].text and len(faults) == 1


@pytest.mark.parametrize("make", RAISES, ids=lambda make: type(make()).__name__)
def test_a_subscriber_that_fails_is_reported_and_the_others_go_on(make: Callable[[], BaseException]) -> None:
    def fail(message: can.Message) -> None:
        raise make()

    with receiving(FakeBus([numbered(k) for k in range(3)])) as (receiver, faults):
        receiver.subscribe(fail, name="plotter")
        frames = receiver.subscribe()
        receiver.start()
        assert [number(frames.get(10.0)) for _ in range(3)] == [0, 1, 2]
        wait_for(lambda: faults)
        assert receiver.alive()
    assert [fault.trouble for fault in faults] == [ReceiveFault.SUBSCRIBER] and "plotter failed" in faults[0].text


def test_an_error_callback_that_fails_does_no_harm(caplog: pytest.LogCaptureFixture) -> None:
    buses = [FakeBus([RAISES[0]]), FakeBus([numbered(1)])]

    def fail(fault: Fault) -> None:
        raise SystemExit

    receiver = Receiver(lambda: buses.pop(0), fail)
    frames = receiver.subscribe()
    with receiver:
        assert number(frames.get(10.0)) == 1
    assert "callback for bus errors failed itself" in caplog.text


def test_a_slow_subscriber_loses_frames_visibly_and_holds_nobody_up() -> None:
    with receiving(FakeBus([numbered(k) for k in range(100)])) as (receiver, faults):
        slow = receiver.subscribe(name="slow one", limit=10)
        quick = receiver.subscribe()
        receiver.start()
        assert [number(quick.get(10.0)) for _ in range(100)] == list(range(100))
        assert slow.lost == 90
        assert [number(slow.get(10.0)) for _ in range(10)] == list(range(10))
    assert [fault.trouble for fault in faults] == [ReceiveFault.OVERFLOW]
    assert "slow one is 10 frames behind test bus" in faults[0].text


def test_everything_taken_in_reaches_a_function_before_stop_returns() -> None:
    seen: list[int] = []
    with receiving(FakeBus([numbered(k) for k in range(500)])) as (receiver, faults):
        receiver.subscribe(lambda message: seen.append(number(message)))
        receiver.start()
        wait_for(lambda: receiver.received == 500)
    assert seen == list(range(500)) and not faults


def test_a_killed_hub_is_reported_and_a_new_one_found(hub: Callable[..., Any], open_bus: Callable[..., Any]) -> None:
    process = hub("test")
    faults: list[Fault] = []
    recovered = threading.Event()
    opener = lambda: can.Bus(interface="rds", channel="test")  # noqa: E731
    with Receiver(opener, faults.append, recovered.set, name="rds:test") as receiver:
        frames = receiver.subscribe()
        with open_bus() as sender:
            sender.send(numbered(1))
            assert number(frames.get(10.0)) == 1
            os.kill(process.pid, signal.SIGKILL)
        assert recovered.wait(30.0)
        with open_bus() as sender:
            sender.send(numbered(2))
            assert number(frames.get(10.0)) == 2
        assert receiver.alive()
    assert [fault.trouble for fault in faults] == [ReceiveFault.BUS]
    assert "ended without a word" in faults[0].text
