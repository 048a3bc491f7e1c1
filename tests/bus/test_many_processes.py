"""The built-in bus between processes: one order for all, nothing lost, senders wait for slow readers."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import can
import pytest
from waiting import wait_for

from .conftest import FORK

BURST = 20_000


def numbered(identifier: int, k: int) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=k.to_bytes(8, "little"))


def collect(count: int, result: Any, ready: Any, pause_every: int = 0) -> None:
    """Receive `count` frames, slowly if asked; send back (identifier, number, stamp) of each."""
    with can.Bus(interface="rds", channel="test") as bus:
        ready.release()
        seen: list[tuple[int, int, float]] = []
        while len(seen) < count:
            message = bus.recv(10.0)
            assert message is not None, f"only {len(seen)} of {count} frames came"
            seen.append((message.arbitration_id, int.from_bytes(message.data, "little"), message.timestamp))
            if pause_every and len(seen) % pause_every == 0:
                time.sleep(0.02)
        result.put(seen)


def flood(identifier: int, count: int, go: Any) -> None:
    with can.Bus(interface="rds", channel="test", can_filters=[{"can_id": 0, "can_mask": 0x7FF}]) as bus:
        go.wait()
        for k in range(count):
            bus.send(numbered(identifier, k))


def test_all_nodes_see_all_frames_in_one_order(start: Callable[..., Any]) -> None:
    results, ready, go = [FORK.Queue() for _ in range(2)], FORK.Semaphore(0), FORK.Event()
    senders = (1, 2, 3)
    for result in results:
        start(collect, 3000 * len(senders), result, ready)
    for _ in results:
        ready.acquire()
    for identifier in senders:
        start(flood, identifier, 3000, go)
    go.set()
    first, second = (result.get(timeout=30) for result in results)
    assert first == second
    for identifier in senders:
        assert [k for who, k, _ in first if who == identifier] == list(range(3000))
    stamps = [stamp for _, _, stamp in first]
    assert stamps == sorted(stamps)


def test_a_slow_reader_gets_every_frame_of_a_burst(
    start: Callable[..., Any], hub: Callable[..., Any], open_bus: Callable[..., can.BusABC]
) -> None:
    hub("test", "--queue", "80000")  # 1,000 frames, so that the sender has to wait many times
    result, ready = FORK.Queue(), FORK.Semaphore(0)
    start(collect, BURST, result, ready, 500)
    ready.acquire()
    bus = open_bus()
    begin = time.monotonic()
    for k in range(BURST):
        bus.send(numbered(1, k))
    assert time.monotonic() - begin > 0.5, "the sender did not wait for the reader, which takes 0.8 s"
    assert [k for _, k, _ in result.get(timeout=30)] == list(range(BURST))


def test_a_full_bus_refuses_within_the_timeout(hub: Callable[..., Any], open_bus: Callable[..., can.BusABC]) -> None:
    hub("test", "--queue", "8000")
    sender, reader = open_bus(), open_bus()
    sent, refused = 0, ""
    while not refused and sent < 5000:
        for timeout in (0.05, 0):  # refused twice: a hub that is held up refuses once
            try:
                sender.send(numbered(1, sent), timeout=timeout)
            except can.CanTimeoutError as error:
                refused += f"{error}\n"
            else:
                sent, refused = sent + 1, ""
                break
    assert "not taken within 0.05 s" in refused and "not taken within 0 s" in refused
    received = []
    while (message := reader.recv(0.2 if len(received) >= sent else 10.0)) is not None:
        received.append(int.from_bytes(message.data, "little"))
    assert received == list(range(sent)), "what was refused must not arrive, all else must"
    sender.send(numbered(1, 0), timeout=10.0)


def join_once(go: Any, result: Any) -> None:
    go.wait()
    with can.Bus(interface="rds", channel="test") as bus:
        result.put(bus.hub_pid)  # type: ignore[attr-defined]
        go_on = time.monotonic() + 0.3
        while time.monotonic() < go_on:
            bus.recv(0.05)


def test_twenty_processes_opening_at_once_share_one_hub(start: Callable[..., Any]) -> None:
    go, result = FORK.Event(), FORK.Queue()
    for _ in range(20):
        start(join_once, go, result)
    go.set()
    assert len({result.get(timeout=30) for _ in range(20)}) == 1


def test_the_hub_ends_after_the_last_node_and_starts_again(
    hub: Callable[..., Any], open_bus: Callable[..., can.BusABC], runtime_directory: Path
) -> None:
    process = hub("test", "--linger", "0.5")
    bus = open_bus()
    time.sleep(0.7)
    assert process.poll() is None
    bus.shutdown()
    assert process.wait(30) == 0
    assert list((runtime_directory / "rds").iterdir()) == []
    bus = open_bus()
    assert bus.hub_pid != process.pid  # type: ignore[attr-defined]


def open_and_close(rounds: int) -> None:
    for _ in range(rounds):
        can.Bus(interface="rds", channel="test").shutdown()
        time.sleep(0.003)


def test_joining_while_the_hub_is_ending(start: Callable[..., Any], hub: Callable[..., Any]) -> None:
    hub("test", "--linger", "0")
    processes = [start(open_and_close, 30) for _ in range(3)]
    for process in processes:
        process.join(60)
        assert process.exitcode == 0


def test_filters_keep_the_hub_from_waking_a_node(open_bus: Callable[..., can.BusABC]) -> None:
    sender, other = open_bus(), open_bus(can_filters=[{"can_id": 0x10, "can_mask": 0x7FF}])
    sender.send(numbered(0x11, 1))
    import select

    assert select.select([other.fileno()], [], [], 0.1)[0] == []
    other.set_filters(None)
    sender.send(numbered(0x11, 2))
    message = other.recv(10.0)
    assert message is not None and message.data[0] == 2


def test_loopback_tcp_carries_the_same(monkeypatch: pytest.MonkeyPatch, open_bus: Callable[..., can.BusABC]) -> None:
    monkeypatch.setenv("RDS_BUS_TRANSPORT", "tcp")
    sender, receiver = open_bus(), open_bus()
    for k in range(2000):
        sender.send(numbered(k % 0x800, k))
    sender.shutdown()
    assert [message.data[:2] for _ in range(2000) if (message := receiver.recv(2.0))] == [
        k.to_bytes(2, "little") for k in range(2000)
    ]


@pytest.mark.parametrize("channel", ["", "../x", "a/b", ".hidden", "ä", "x" * 33, "a\nb", "a b", "-x"])
def test_hostile_channel_names_are_refused(open_bus: Callable[..., can.BusABC], channel: str) -> None:
    with pytest.raises(ValueError, match="must be 1 to 32"):
        open_bus(channel)


def test_unknown_options_are_refused(open_bus: Callable[..., can.BusABC]) -> None:
    with pytest.raises(ValueError, match="no option baud"):
        open_bus(baud=500_000)


def test_a_directory_that_others_can_enter_is_refused(
    runtime_directory: Path, open_bus: Callable[..., can.BusABC]
) -> None:
    (runtime_directory / "rds").mkdir(mode=0o755)
    with pytest.raises(can.CanInitializationError, match="only you can enter"):
        open_bus()
    os.chmod(runtime_directory / "rds", 0o700)
    open_bus()


def test_frames_sent_before_leaving_arrive(open_bus: Callable[..., can.BusABC]) -> None:
    receiver, sender = open_bus(), open_bus()
    for k in range(200):
        sender.send(numbered(1, k))
    sender.shutdown()
    assert all(receiver.recv(10.0) is not None for _ in range(200))
    wait_for(lambda: receiver.recv(0) is None)
