"""What any python-can interface does: one suite for the built-in bus and python-can's own `virtual`."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from typing import Any
from uuid import uuid4

import can
import pytest
from can.interfaces.virtual import VirtualBus

from rds.bus.hub import builtin

Opener = Callable[..., can.BusABC]


@pytest.fixture(params=["rds", "virtual"])
def opener(request: pytest.FixtureRequest) -> Iterator[Opener]:
    channel = uuid4().hex
    with ExitStack() as stack:
        yield lambda **options: stack.enter_context(can.Bus(interface=request.param, channel=channel, **options))


def frame(identifier: int, data: bytes = b"", **fields: Any) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=fields.pop("extended", False), **fields)


MESSAGES = [
    frame(0),
    frame(0x7FF, b"12345678"),
    frame(0x1FFFFFFF, b"\x00\xff", extended=True),
    frame(0x123, extended=True),  # fits 11 bits, and is extended all the same
    frame(0x20, dlc=8, is_remote_frame=True),
    frame(0x1, b"\x01", is_error_frame=True),
    frame(0x5, bytes(range(64)), is_fd=True, bitrate_switch=True),
    frame(0x6, bytes(12), is_fd=True, error_state_indicator=True),
    frame(0x7, is_fd=True, extended=True),
]


@pytest.mark.parametrize("message", MESSAGES, ids=str)
def test_all_fields_arrive(opener: Opener, message: can.Message) -> None:
    sender, receiver = opener(), opener()
    before = time.time()
    sender.send(message)
    received = receiver.recv(10.0)
    assert received is not None
    assert received.equals(message, timestamp_delta=None, check_channel=False)
    assert before - 0.01 < received.timestamp < time.time() + 0.01
    assert received.is_rx


def test_a_node_does_not_hear_itself_unless_it_asks(opener: Opener) -> None:
    deaf, hearing, other = opener(), opener(receive_own_messages=True), opener()
    deaf.send(frame(1))
    hearing.send(frame(2))
    seen = [(m.arbitration_id, m.is_rx) for m in (hearing.recv(10.0), hearing.recv(10.0)) if m]
    assert seen == [(1, True), (2, False)]
    assert [m.arbitration_id for m in (other.recv(10.0), other.recv(10.0)) if m] == [1, 2]
    heard = deaf.recv(10.0)
    assert heard is not None and heard.arbitration_id == 2
    assert deaf.recv(0) is None


@pytest.mark.parametrize(
    "filters, passing",
    [
        (None, [0x10, 0x11, 0x110, 0x10010]),
        ([], [0x10, 0x11, 0x110, 0x10010]),
        ([{"can_id": 0x10, "can_mask": 0x7FF}], [0x10, 0x10010]),  # without "extended" only masked bits count
        ([{"can_id": 0x10, "can_mask": 0x1FFFFFFF, "extended": False}], [0x10]),
        ([{"can_id": 0x10, "can_mask": 0x0F, "extended": True}], [0x10010]),
        ([{"can_id": 0x11, "can_mask": 0x7FF}, {"can_id": 0x100, "can_mask": 0x700, "extended": False}], [0x11, 0x110]),
        ([{"can_id": k, "can_mask": 0x1FFFFFFF} for k in range(0x11, 0x40)], [0x11]),
    ],
)
def test_filters(opener: Opener, filters: Any, passing: list[int]) -> None:
    sender, at_open, later = opener(), opener(can_filters=filters), opener(can_filters=[{"can_id": 9, "can_mask": 9}])
    later.set_filters(filters)
    for identifier in (0x10, 0x11, 0x110, 0x10010):
        sender.send(frame(identifier, extended=identifier > 0x7FF))
    for bus in (at_open, later):
        received = [message.arbitration_id for _ in passing if (message := bus.recv(10.0))]
        assert received == passing and bus.recv(0.05) is None


def test_filters_may_be_any_iterable() -> None:
    """Of a generator nothing was left for the second look at each frame: none passed."""
    with can.Bus("any", interface="rds") as sender, can.Bus("any", interface="rds") as receiver:
        receiver.set_filters(each for each in [{"can_id": 3, "can_mask": 0x7FF}])
        for identifier in (1, 3, 3):
            sender.send(frame(identifier))
        heard = [message.arbitration_id for message in (receiver.recv(10.0), receiver.recv(10.0)) if message]
        assert heard == [3, 3] and receiver.filters == [{"can_id": 3, "can_mask": 0x7FF}]


@pytest.mark.parametrize("wrong", [{"can_id": 1}, {"can_id": 1.0, "can_mask": 1}, 5])
def test_what_is_no_filter_is_refused_and_changes_nothing(wrong: Any) -> None:
    with can.Bus("any", interface="rds") as sender, can.Bus("any", interface="rds") as receiver:
        with pytest.raises(ValueError, match="must be a dict with the whole numbers can_id and can_mask"):
            receiver.set_filters([{"can_id": 3, "can_mask": 0x7FF}, wrong])
        sender.send(frame(9))
        heard = receiver.recv(10.0)
        assert heard is not None and receiver.filters is None
    with pytest.raises(ValueError, match="must be a dict"):
        can.Bus("any", interface="rds", can_filters=[wrong])


def test_filters_hold_for_what_waits_already(opener: Opener) -> None:
    sender, receiver = opener(), opener()
    for identifier in (1, 2, 3):
        sender.send(frame(identifier))
    time.sleep(0.05)
    receiver.set_filters([{"can_id": 3, "can_mask": 0x7FF}])
    message = receiver.recv(10.0)
    assert message is not None and message.arbitration_id == 3


def test_recv_waits_as_long_as_asked(opener: Opener) -> None:
    bus = opener()
    for timeout in (0, 0.001, 0.05):
        took = []
        for _ in range(10):
            start = time.perf_counter()
            assert bus.recv(timeout) is None
            took.append(time.perf_counter() - start + 1e-4)
        assert timeout <= min(took) < timeout + 0.05, "a busy computer makes some of them longer, not all"


def test_periodic_sending(opener: Opener) -> None:
    sender, receiver = opener(), opener()
    task = sender.send_periodic(frame(7), 0.01)
    messages = [receiver.recv(10.0) for _ in range(5)]
    task.stop()
    assert all(m is not None and m.arbitration_id == 7 for m in messages)


@pytest.mark.parametrize("period", [0.0, -0.01, float("nan")])
def test_a_period_that_is_none_is_refused(period: float) -> None:
    with can.Bus("any", interface="rds") as sender, can.Bus("any", interface="rds") as receiver:
        with pytest.raises(ValueError, match=r"period .* s must be more than 0; send\(\) sends once"):
            sender.send_periodic(frame(7), period)
        assert receiver.recv(0.05) is None


@pytest.mark.parametrize(
    "given, why",
    [
        ({"is_fd": True, "is_remote_frame": True}, "CAN FD has no remote frames; ask by a classic one"),
        ({"is_remote_frame": True, "dlc": 1, "data": b"a"}, "a remote frame has no data, and this one 1 bytes"),
        ({"arbitration_id": -1}, "identifier -1 is less than 0"),
    ],
)
def test_a_frame_that_cannot_be_is_refused_with_the_reason(given: dict[str, Any], why: str) -> None:
    message = frame(1)
    for name, value in given.items():
        setattr(message, name, value)
    with can.Bus("any", interface="rds") as bus, pytest.raises(ValueError, match=why):
        bus.send(message)


def test_a_state_that_is_asked_for_is_refused() -> None:
    with can.Bus("any", interface="rds") as bus:
        with pytest.raises(NotImplementedError, match=r"cannot be set to BusState.PASSIVE: .* no node .* only listens"):
            bus.state = can.BusState.PASSIVE
        assert bus.state is can.BusState.ACTIVE


def test_own_frames_come_back_marked(opener: Opener) -> None:
    sender, receiver = opener(receive_own_messages=True), opener()
    sender.send(frame(7))
    own, others = sender.recv(10.0), receiver.recv(10.0)
    assert own is not None and others is not None
    assert (own.is_rx, others.is_rx) == (False, True) and own.timestamp == others.timestamp


def test_notifier_thread(opener: Opener) -> None:
    sender, receiver = opener(), opener()
    listener = can.BufferedReader()
    notifier = can.Notifier(receiver, [listener], timeout=0.1)
    for identifier in range(100):
        sender.send(frame(identifier))
    seen = [message.arbitration_id for _ in range(100) if (message := listener.get_message(10.0))]
    notifier.stop()
    assert seen == list(range(100))


def test_notifier_with_asyncio(opener: Opener) -> None:
    sender, receiver = opener(), opener()

    async def receive() -> list[int]:
        reader = can.AsyncBufferedReader()
        notifier = can.Notifier(receiver, [reader], timeout=0.1, loop=asyncio.get_running_loop())
        for identifier in range(100):
            sender.send(frame(identifier))
        seen = [(await asyncio.wait_for(reader.get_message(), 10.0)).arbitration_id for _ in range(100)]
        notifier.stop()
        return seen

    assert asyncio.run(receive()) == list(range(100))


def test_shutdown_may_be_repeated_and_ends_the_bus(opener: Opener) -> None:
    bus = opener()
    bus.shutdown()
    bus.shutdown()
    with pytest.raises(can.CanOperationError):
        bus.send(frame(1))
    with pytest.raises(can.CanOperationError):
        bus.recv(0.01)


def test_messages_bear_the_channel_as_it_was_given(opener: Opener) -> None:
    interface = "virtual" if isinstance(opener(), VirtualBus) else "rds"
    with can.Bus(7341, interface=interface) as sender, can.Bus(7341, interface=interface) as receiver:
        sender.send(frame(1))
        sender.send(frame(1, extended=True))
        assert [message.channel for message in (receiver.recv(10.0), receiver.recv(10.0)) if message] == [7341, 7341]


def test_fd_as_the_tools_of_python_can_give_it(opener: Opener) -> None:
    sender, receiver = opener(fd=True), opener(fd=True)
    sender.send(frame(5, bytes(64), is_fd=True))
    received = receiver.recv(10.0)
    assert received is not None and received.is_fd and len(received.data) == 64


def test_a_node_without_fd_sends_no_fd_frames() -> None:
    channel = uuid4().hex
    with can.Bus(channel, interface="rds", fd=False) as classic, can.Bus(channel, interface="rds") as other:
        assert (classic.protocol, other.protocol) == (can.CanProtocol.CAN_20, can.CanProtocol.CAN_FD)
        with pytest.raises(ValueError, match="opened with fd=False"):
            classic.send(frame(5, is_fd=True))
        other.send(frame(6, bytes(12), is_fd=True))
        classic.send(frame(7))
        heard, last = classic.recv(10.0), other.recv(10.0)
        assert heard is not None and heard.is_fd
        assert last is not None and last.arbitration_id == 7
    for option in ("fd", "receive_own_messages"):
        with pytest.raises(ValueError, match=f"{option} 'maybe' must be true or false"):
            builtin.BuiltinBus(channel, **{option: "maybe"})  # type: ignore[arg-type]


class Failures(can.Listener):
    """Keeps what ends a notifier's thread, and says that it is dealt with."""

    def __init__(self) -> None:
        self.seen: list[Exception] = []

    def on_message_received(self, msg: can.Message) -> None:
        pass

    def on_error(self, exc: Exception) -> bool:  # type: ignore[override]
        self.seen.append(exc)
        return True


def test_a_thread_that_is_woken_for_nothing_waits_to_its_own_time_and_no_longer(monkeypatch: Any) -> None:
    """Of two threads that read one bus, both are woken by a frame, and one of them gets it."""
    wait, woken = builtin._wait, iter([True, True])
    monkeypatch.setattr(builtin, "_wait", lambda *given: next(woken, False) or wait(*given))
    with ThreadPoolExecutor(1) as pool, can.Bus(uuid4().hex, interface="rds") as bus:
        assert pool.submit(bus.recv, 0.05).result(timeout=30.0) is None
    assert next(woken, None) is None


def test_a_wait_ends_in_peace_when_another_thread_shuts_the_bus_down(opener: Opener) -> None:
    """As canopen's `Network.disconnect` does it: the notifier is told to stop, not waited for, and the bus closed."""
    bus, failures = opener(), Failures()
    notifier = can.Notifier(bus, [failures], timeout=0.2)
    time.sleep(0.05)
    notifier.stop(0)
    bus.shutdown()
    notifier.stop(30.0)
    assert failures.seen == [] and notifier.exception is None


def test_timing_objects_of_python_can_give_the_bit_rates() -> None:
    classic = can.BitTiming.from_sample_point(f_clock=8_000_000, bitrate=500_000, sample_point=87.5)
    flexible = can.BitTimingFd.from_sample_point(
        f_clock=80_000_000,
        nom_bitrate=500_000,
        nom_sample_point=80.0,
        data_bitrate=2_000_000,
        data_sample_point=80.0,
    )
    for timing, expected in ((classic, (500_000, 0)), (flexible, (500_000, 2_000_000))):
        with can.Bus(uuid4().hex, interface="rds", timing=timing) as bus:
            assert isinstance(bus, builtin.BuiltinBus) and (bus.bitrate, bus.data_bitrate) == expected
    parts = {key: getattr(classic, key) for key in ("f_clock", "brp", "tseg1", "tseg2", "sjw", "nof_samples")}
    with can.Bus(uuid4().hex, interface="rds", **parts) as bus:  # as python-can's tools and files give it
        assert isinstance(bus, builtin.BuiltinBus) and bus.bitrate == 500_000
    with pytest.raises(ValueError, match="bitrate 250000 is not that of timing, 500000"):
        can.Bus(uuid4().hex, interface="rds", timing=classic, bitrate=250_000)
