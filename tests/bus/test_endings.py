"""Nodes and hubs that are killed, stopped or talk rubbish: a clear error where it belongs, nothing elsewhere."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest
from waiting import wait_for

from rds.bus.hub import connect, wire
from rds.bus.hub.error_states import SEATS, ErrorStateFile
from rds.bus.hub.hub_loop import STALL

from .conftest import FORK

Opener = Callable[..., can.BusABC]


def numbered(k: int) -> can.Message:
    return can.Message(arbitration_id=1, is_extended_id=False, data=k.to_bytes(8, "little"))


def sit(ready: Any) -> None:
    """A node that reads nothing."""
    bus = can.Bus(interface="rds", channel="test")
    ready.set()
    time.sleep(60)
    bus.shutdown()


def read_to_the_end(ready: Any, result: Any) -> None:
    """Count frames until the bus ends; send back the count and the error."""
    logging.disable(logging.CRITICAL)
    count = 0
    with can.Bus(interface="rds", channel="test") as bus:
        ready.set()
        try:
            while True:
                count += bus.recv(1.0) is not None
        except can.CanOperationError as error:
            result.put((count, str(error)))


def fill(bus: can.BusABC) -> int:
    """Send until the bus takes no more, twice in a row: a hub that is held up refuses once; return how many it took."""
    sent = refused = 0
    while sent < 100_000 and refused < 2:
        try:
            bus.send(numbered(sent), timeout=0.1)
            sent, refused = sent + 1, 0
        except can.CanTimeoutError:
            refused += 1
    assert refused, "the bus never filled"
    return sent


def test_a_killed_reader_holds_nobody_up(start: Callable[..., Any], hub: Callable[..., Any], open_bus: Opener) -> None:
    hub("test", "--queue", "8000")
    ready = FORK.Event()
    reader = start(sit, ready)
    ready.wait()
    bus = open_bus()
    fill(bus)
    reader.kill()
    for k in range(2000):
        bus.send(numbered(k), timeout=0.8 * STALL)


def test_a_hub_that_stands_still_is_named(hub: Callable[..., Any], open_bus: Opener) -> None:
    process = hub("test")
    bus = open_bus()
    os.kill(process.pid, signal.SIGSTOP)
    try:
        with pytest.raises(can.CanTimeoutError, match=rf"the hub \(process {process.pid}\) stands still"):
            for k in range(100_000):
                bus.send(numbered(k), timeout=0.0)
    finally:
        os.kill(process.pid, signal.SIGCONT)


def test_a_stopped_reader_is_let_go_and_told_why(
    start: Callable[..., Any], hub: Callable[..., Any], open_bus: Opener
) -> None:
    process = hub("test", "--queue", "8000", "--stall", "0.5")
    ready, result = FORK.Event(), FORK.Queue()
    reader = start(read_to_the_end, ready, result)
    ready.wait()
    os.kill(reader.pid, signal.SIGSTOP)
    bus, witness = open_bus(), open_bus()
    seen: list[int] = []
    over = threading.Event()

    def read() -> None:
        while not over.is_set():
            if (message := witness.recv(0.1)) is not None:
                seen.append(int.from_bytes(message.data, "little"))

    thread = threading.Thread(target=read)
    thread.start()
    sent = fill(bus)
    begin = time.monotonic()
    bus.send(numbered(sent), timeout=2 * STALL)
    assert time.monotonic() - begin < STALL, "it was let go after 0.5 s, not after the time that is usual"
    wait_for(lambda: len(seen) == sent + 1)
    over.set()
    thread.join()
    assert seen == list(range(sent + 1))
    os.kill(reader.pid, signal.SIGCONT)
    count, error = result.get(timeout=30)
    assert "read nothing for 0.5 s while others waited" in error
    assert 0 < count < sent
    process.terminate()
    assert "read nothing for 0.5 s" in process.communicate(timeout=30)[1]


def test_a_node_that_was_let_go_learns_it_when_it_sends(
    hub: Callable[..., Any], open_bus: Opener, caplog: pytest.LogCaptureFixture
) -> None:
    hub("test", "--queue", "8000", "--stall", "0.3")
    bus, lazy = open_bus(), open_bus()
    fill(bus)
    bus.send(numbered(0), timeout=0.8 * STALL)
    with pytest.raises(can.CanOperationError, match=r"read nothing for 0\.3 s"):
        lazy.send(numbered(0))
    assert "read nothing" in caplog.text
    received = 0
    with pytest.raises(can.CanOperationError, match="read nothing"):
        while lazy.recv(0) is not None:
            received += 1
    assert received > 100, "what had arrived stays readable"


def send_for_ever() -> None:
    with can.Bus(interface="rds", channel="test", can_filters=[{"can_id": 0, "can_mask": 0x7FF}]) as bus:
        k = 0
        while True:
            bus.send(numbered(k))
            k += 1


def test_a_killed_sender_leaves_whole_frames(start: Callable[..., Any], open_bus: Opener) -> None:
    bus, other = open_bus(), open_bus(can_filters=[{"can_id": 2, "can_mask": 0x7FF}])
    sender = start(send_for_ever)
    for k in range(2000):
        message = bus.recv(10.0)
        assert message is not None and int.from_bytes(message.data, "little") == k
    sender.kill()
    k = 2000
    while (message := bus.recv(0.2)) is not None:
        assert int.from_bytes(message.data, "little") == k
        k += 1
    bus.send(can.Message(arbitration_id=2, is_extended_id=False))
    assert other.recv(10.0) is not None


def test_a_hub_ends_although_a_node_had_more_to_send_than_others_stayed_for(
    hub: Callable[..., Any], open_bus: Opener
) -> None:
    """It waited for ever for its frames to go, on a slow bus on which nobody was left."""
    process = hub("test", "--linger", "0.5")
    sender, reader = open_bus(bitrate=10_000), open_bus()
    fill(sender)
    sender.shutdown()
    time.sleep(0.3)  # the hub has seen it
    reader.shutdown()
    assert process.wait(30) == 0


def test_a_file_of_error_states_for_which_there_is_no_room_is_refused(
    open_bus: Opener, runtime_directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hub that wrote where a full disk had no page was killed."""
    path = runtime_directory / "states"
    states = ErrorStateFile(path)
    assert path.stat().st_blocks * 512 >= SEATS
    states.remove()
    with monkeypatch.context() as patched, pytest.raises(OSError, match="No space left"):
        patched.setattr(os, "write", lambda descriptor, data: 512)
        ErrorStateFile(path)
    assert not path.exists()
    (runtime_directory / "rds").mkdir(mode=0o700, exist_ok=True)
    (runtime_directory / "rds" / "test.states").mkdir()
    with pytest.raises(can.CanInitializationError, match="refused: the file of its error states cannot be made"):
        open_bus(bitrate=500_000)


def test_a_killed_hub_is_an_error_at_every_node(open_bus: Opener, caplog: pytest.LogCaptureFixture) -> None:
    first, second, third = open_bus(), open_bus(), open_bus()
    waiting: list[BaseException] = []

    def wait() -> None:
        try:
            third.recv(None)
        except can.CanOperationError as error:
            waiting.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    hub: int = first.hub_pid  # type: ignore[attr-defined]
    os.kill(hub, signal.SIGKILL)
    with pytest.raises(can.CanOperationError, match=rf"hub \(process {hub}\) ended without a word"):
        first.recv(10.0)
    with pytest.raises(can.CanOperationError, match="ended without a word"):
        second.send(numbered(0))
    thread.join(30.0)
    assert len(waiting) == 1
    assert caplog.text.count("ended without a word") >= 3
    for bus in (first, second, third):
        with pytest.raises(can.CanOperationError):
            bus.recv(0)
    again, other = open_bus(), open_bus()
    again.send(numbered(5))
    assert other.recv(10.0) is not None


@pytest.mark.parametrize("end", ["kill", "shutdown"])
def test_filters_of_a_bus_that_is_gone_are_not_given_to_the_node_that_has_its_number_now(
    open_bus: Opener, end: str
) -> None:
    """The next hub on the channel counts its nodes from 1 again."""
    old, sender = open_bus(), open_bus()
    os.kill(old.hub_pid, signal.SIGKILL)  # type: ignore[attr-defined]
    with pytest.raises(can.CanOperationError):
        sender.recv(10.0)
    if end == "shutdown":
        old.shutdown()
    new, sender = open_bus(), open_bus()
    with pytest.raises(can.CanOperationError, match="ended without a word" if end == "kill" else "shut down"):
        old.set_filters([{"can_id": 0x7FF, "can_mask": 0x7FF}])
    sender.send(numbered(0))
    assert new.recv(10.0) is not None


def test_a_hub_that_is_told_to_end_says_so(hub: Callable[..., Any], open_bus: Opener) -> None:
    process = hub()
    bus = open_bus()
    process.terminate()
    with pytest.raises(can.CanOperationError, match="the hub was told to end"):
        bus.recv(10.0)


def test_an_address_that_was_removed_ends_the_bus_loudly(open_bus: Opener, runtime_directory: Path) -> None:
    bus = open_bus()
    (runtime_directory / "rds" / "test.sock").unlink()
    with pytest.raises(can.CanOperationError, match="was removed"):
        bus.recv(30.0)


def test_an_event_loop_hears_of_the_end_once(open_bus: Opener) -> None:
    bus = open_bus()
    errors: list[str] = []

    async def watch() -> None:
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, context: errors.append(str(context["exception"])))
        notifier = can.Notifier(bus, [can.AsyncBufferedReader()], timeout=0.1, loop=loop)
        os.kill(bus.hub_pid, signal.SIGKILL)  # type: ignore[attr-defined]
        for _ in range(3000):
            if errors:
                break
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.1)  # not twice
        notifier.stop()

    asyncio.run(watch())
    assert len(errors) == 1 and "ended without a word" in errors[0]


def test_a_stopped_hub_is_named(hub: Callable[..., Any], open_bus: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    process = hub()
    os.kill(process.pid, signal.SIGSTOP)
    monkeypatch.setattr("rds.bus.hub.connect.join.__defaults__", (0.3,))
    with pytest.raises(can.CanInitializationError, match="does not answer"):
        open_bus()


HELLO = wire.encode_hello(wire.Hello(wire.JOIN, False, 0, 0, bytes(32)))


@pytest.mark.parametrize(
    "rubbish, reason",
    [
        (b"GET / HTTP/1.0\r\n" * 5, "instead of a hello"),
        (wire.record(wire.HELLO, b"x" * 60), "another program or version"),
        (wire.encode_hello(wire.Hello(7, False, 0, 0, bytes(32))), "purpose 7 is unknown"),
        (wire.encode_hello(wire.Hello(wire.RETUNE, False, 0, 99, bytes(32))), "no node 99"),
        (wire.encode_hello(wire.Hello(wire.JOIN, False, 0, 0, b"y" * 32)), "token is wrong"),
        (wire.encode_hello(wire.Hello(wire.JOIN, False, 1, 0, bytes(32))) * 2, "instead of filters"),
        (HELLO * 2, "only frames may come"),
        (HELLO + wire.HEADER.pack(0, 0x800, wire.FRAME, 0, 0, 0) + bytes(64), "too large for 11 bits"),
        (HELLO + wire.HEADER.pack(0, 1, wire.FRAME, 0, 9, 9) + bytes(64), "no length of a CAN frame"),
        (HELLO + wire.HEADER.pack(0, 1, wire.FRAME, wire.FD, 63, 63) + bytes(64), "no length of a CAN FD frame"),
        (HELLO + wire.HEADER.pack(0, 1, wire.FRAME, wire.OWN, 0, 0) + bytes(64), "contradict"),
        (HELLO + bytes(range(256)) * 200, ""),
    ],
    ids=range(12),
)
def test_rubbish_ends_only_its_own_connection(
    open_bus: Opener, runtime_directory: Path, rubbish: bytes, reason: str
) -> None:
    first, second = open_bus(), open_bus()
    with socket.socket(socket.AF_UNIX) as visitor:
        visitor.settimeout(30.0)
        visitor.connect(str(runtime_directory / "rds" / "test.sock"))
        try:
            visitor.sendall(rubbish)
        except OSError:
            assert reason == ""  # it was thrown out while it still talked
        answer = b""
        try:
            while more := visitor.recv(4096):
                answer += more
        except ConnectionResetError:
            pass
    assert reason.encode() in answer
    first.send(numbered(1))
    assert second.recv(10.0) is not None


@pytest.mark.parametrize("part", [b"", HELLO[:50], HELLO + HELLO[:79]])
def test_partial_records_hurt_nobody(open_bus: Opener, runtime_directory: Path, part: bytes) -> None:
    first, second = open_bus(), open_bus()
    with socket.socket(socket.AF_UNIX) as visitor:
        visitor.connect(str(runtime_directory / "rds" / "test.sock"))
        visitor.sendall(part)
        first.send(numbered(1))
        assert second.recv(10.0) is not None
    first.send(numbered(2))
    assert second.recv(10.0) is not None


def test_many_connections_that_say_nothing(open_bus: Opener, runtime_directory: Path) -> None:
    first, second = open_bus(), open_bus()
    visitors = [socket.socket(socket.AF_UNIX) for _ in range(300)]
    for visitor in visitors:
        visitor.connect(
            str(runtime_directory / "rds" / "test.sock")
        )  # waits for room, as it would not with a time limit
        visitor.settimeout(30.0)
    first.send(numbered(1))
    assert second.recv(10.0) is not None
    for visitor in visitors:
        visitor.close()
    wait_for(lambda: first.send(numbered(2)) is None and second.recv(10.0) is not None)


def test_one_that_stood_still_long_enough_before_is_let_go_without_a_wait(
    hub: Callable[..., Any], open_bus: Opener
) -> None:
    hub("test", "--queue", "80000", "--stall", "0.5")
    bus, lazy = open_bus(), open_bus()
    longest = 0.0
    for k in range(2000):  # in 2 s; the queue and the socket are full after about 1.3 s
        begin = time.monotonic()
        bus.send(numbered(k), timeout=2.0)
        longest = max(longest, time.monotonic() - begin)
        time.sleep(0.001)
    assert longest < 0.4, "a wait would be one of 0.5 s"
    with pytest.raises(can.CanOperationError, match="read nothing"):
        while True:
            lazy.recv(0)


@pytest.mark.parametrize("bitrate", [None, 1_000_000])
def test_a_frame_whose_length_is_not_that_of_its_data_is_not_sent(bitrate: int | None, open_bus: Opener) -> None:
    sender, receiver = open_bus(bitrate=bitrate), open_bus()
    with pytest.raises(ValueError, match="1 bytes of data, and its length \\(dlc\\) says 3"):
        sender.send(can.Message(arbitration_id=1, is_extended_id=False, data=b"a", dlc=3))
    sender.send(can.Message(arbitration_id=2, is_extended_id=False, is_remote_frame=True, dlc=3))
    message = receiver.recv(10.0)
    assert message is not None and (message.arbitration_id, message.dlc) == (2, 3)


def test_a_bus_that_is_shut_down_refuses_periodic_frames_to_its_caller(open_bus: Opener) -> None:
    bus = open_bus()
    bus.shutdown()
    with pytest.raises(can.CanOperationError, match="this bus has been shut down"):
        bus.send_periodic(can.Message(arbitration_id=7, is_extended_id=False), 0.01)


def test_a_bus_that_is_shut_down_ends_fast_periodic_sending_quietly(
    open_bus: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[object] = []
    monkeypatch.setattr(threading, "excepthook", said.append)
    for _ in range(20):
        sender = open_bus()
        tasks = [sender.send_periodic(numbered(k), 0.0001) for k in range(4)]
        time.sleep(0.005)
        sender.shutdown()
        assert not any(task.thread.is_alive() for task in tasks)  # type: ignore[attr-defined]
    assert said == []


def test_a_hub_that_never_starts_is_given_up_where_no_process_forks(monkeypatch: pytest.MonkeyPatch) -> None:
    """On Windows the hub says by a file that it listens; one that ends at once must not be started for ever."""
    monkeypatch.delattr(os, "fork", raising=False)
    monkeypatch.setattr(connect, "_start_hub_on_windows", lambda address, deadline: time.sleep(0.01))
    with pytest.raises(TimeoutError, match="the hub of channel 'test' did not start in time"):
        connect.join("test", False, (), wire.Settings(), timeout=0.1)
