"""The socketcand server, with python-can's own client and with clients that misbehave."""

from __future__ import annotations

import logging
import os
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any

import can
import pytest
from bus.conftest import wait_for
from hypothesis import given, settings
from hypothesis import strategies as st

from bus_tools.made_frames import frame, kept, of_every_kind
from rds.bus.hub.hub_loop import STALL
from rds.bus.tools import socketcand as module
from rds.bus.tools import socketcand_words as words
from rds.bus.tools.link import open_bus as open_any
from rds.bus.tools.receiver import Fault
from rds.bus.tools.socketcand import Server
from rds.core.errors import InputError

Opener = Callable[..., can.BusABC]


@pytest.fixture
def server() -> Iterator[Server]:
    with Server(partial(open_any, "rds", "test"), "test", port=0) as server:
        yield server


@pytest.fixture
def client(server: Server) -> Iterator[Callable[..., can.BusABC]]:
    """Opens python-can's client."""
    opened = []

    def opener(port: int | None = None) -> can.BusABC:
        bus = can.Bus(
            interface="socketcand",
            channel="test",
            host="127.0.0.1",
            port=port or server.address[1],
            tcp_tune=True,
            ignore_config=True,
        )
        opened.append(bus)
        return bus

    yield opener
    for bus in opened:
        bus.shutdown()


@pytest.fixture
def raw(server: Server) -> Iterator[Callable[..., socket.socket]]:
    """Opens plain connections; with `opened`, ones that get frames."""
    opened = []

    def opener(in_raw_mode: bool = True) -> socket.socket:
        sock = socket.create_connection(server.address)
        sock.settimeout(2.0)
        opened.append(sock)
        assert sock.recv(100) == b"< hi >"
        if in_raw_mode:
            sock.sendall(b"< open test >< rawmode >")
            assert [sock.recv(6) for _ in range(2)] == [b"< ok >"] * 2
        return sock

    yield opener
    for sock in opened:
        sock.close()


def drain(bus: can.BusABC, quiet: float = 0.3) -> list[can.Message]:
    return list(iter(lambda: bus.recv(quiet), None))


def test_frames_both_ways(client: Callable[..., can.BusABC], open_bus: Opener) -> None:
    bus, tool = open_bus(), client()
    for message in (frame(0x7FF, bytes(range(8))), frame(0x700), frame(0x21, b"\x01", is_extended_id=True)):
        bus.send(message)
        found = tool.recv(10.0)
        assert found is not None and kept(found) == kept(message)
        assert found.timestamp == pytest.approx(time.time(), abs=5.0)
        tool.send(message)
        found = bus.recv(10.0)
        assert found is not None and kept(found) == kept(message)
    assert tool.recv(0.1) is None, "a client does not hear itself"


def test_clients_see_each_other(client: Callable[..., can.BusABC]) -> None:
    one, two = client(), client()
    one.send(frame(0x700, b"\x01"))
    found = two.recv(2.0)
    assert found is not None and found.data == b"\x01"


def test_a_client_that_joins_a_busy_bus(client: Callable[..., can.BusABC], open_bus: Opener) -> None:
    bus = open_bus()
    task = bus.send_periodic(frame(0x700, bytes(8)), 0.0005)
    try:
        for _ in range(10):
            assert client().recv(2.0) is not None
    finally:
        task.stop()


def test_what_the_protocol_has_no_words_for(
    client: Callable[..., can.BusABC], raw: Callable[..., socket.socket], open_bus: Opener, caplog: Any
) -> None:
    bus, tool, plain = open_bus(), client(), raw()
    for message in of_every_kind():
        if not message.is_error_frame:
            bus.send(message)
    data = [kept(m) for m in of_every_kind() if not (m.is_error_frame or m.is_fd or m.is_remote_frame)]
    assert [kept(message) for message in drain(tool)] == data
    text = plain.recv(4096)
    assert text.count(b"< rtr ") == 3 and b"< rtr 102 " in text and text.count(b"< frame ") == len(data)
    assert caplog.text.count("does not get CAN FD frames") == 2
    tool.send(frame(0x700, bytes(64), is_fd=True))  # sent by a client that knows no better
    tool.send(frame(0x700, is_remote_frame=True, dlc=4))
    assert not drain(bus)
    assert "no CAN FD frames" in caplog.text and "asked for by sendrtr" in caplog.text
    plain.sendall(b"< sendrtr 700 4 >")
    found = bus.recv(10.0)
    assert found is not None and found.is_remote_frame and found.dlc == 4


def test_frames_that_act_on_a_machine_are_not_taken(
    client: Callable[..., can.BusABC], open_bus: Opener, caplog: Any
) -> None:
    bus, tool = open_bus(), client()
    tool.send(frame(0x010, bytes(8)))
    tool.send(frame(0x700))
    assert [message.arbitration_id for message in drain(bus)] == [0x700]
    assert "frame 0x010 is left out: it sets voltages; see --with-commands" in caplog.text


def test_with_commands_they_are(open_bus: Opener) -> None:
    bus = open_bus()
    with (
        Server(partial(open_any, "rds", "test"), "test", port=0, with_commands=True) as server,
        can.Bus(
            interface="socketcand", channel="test", host="127.0.0.1", port=server.address[1], tcp_tune=True
        ) as tool,
    ):
        tool.send(frame(0x010, bytes(8)))
        assert bus.recv(10.0) is not None


def test_echo_in_every_state_and_modes(raw: Callable[..., socket.socket]) -> None:
    sock = raw(in_raw_mode=False)
    for sent, answer in (
        (b"< echo >", b"< echo >"),
        (b"<echo>\n", b"< echo >"),
        (b"< rawmode >", b"< error unknown command >"),
        (b"< open test >", b"< ok >"),
        (b"< echo >", b"< echo >"),
        (b"< bcmmode >", b"< ok >"),
        (b"< subscribe 0 0 123 >", b"< error unknown command >"),
    ):
        sock.sendall(sent)
        assert sock.recv(100) == answer
    for byte in b"< echo >":
        sock.sendall(bytes([byte]))
    assert sock.recv(100) == b"< echo >"


def test_another_bus_is_refused(raw: Callable[..., socket.socket]) -> None:
    sock = raw(in_raw_mode=False)
    sock.sendall(b"< open can0 >")
    assert sock.recv(100) == b"< error could not open bus >"
    assert sock.recv(100) == b""


@pytest.mark.parametrize(
    "garbage",
    [b"\0\xff" * 3000, b"<" * 5000, b">" * 5000, b"< send", b"GET / HTTP/1.1\r\n\r\n", b"<>< >", b"< " + b"x" * 9000],
)
def test_garbage_harms_nobody(
    garbage: bytes, raw: Callable[..., socket.socket], client: Callable[..., can.BusABC], open_bus: Opener
) -> None:
    bus, tool, bad = open_bus(), client(), raw()
    bad.sendall(garbage)
    time.sleep(0.05)
    bus.send(frame(0x700, b"\x07"))
    found = tool.recv(10.0)
    assert found is not None and found.data == b"\x07"
    bad.sendall(b" >< send 701 1 2 >")
    found = bus.recv(10.0)
    assert found is not None and found.arbitration_id == 0x701


@pytest.mark.parametrize(
    "text",
    [
        "send",
        "send 123",
        "send xyz 0",
        "send 800 0",
        "send 20000000 0",
        "send 123 -1",
        "send 123 9 1 2 3 4 5 6 7 8 9",
        "send 123 2 1",
        "send 123 1 1 2",
        "send 123 1 123",
        "send 123 1 xx",
        "send 123 1 +1",
        "send 123 ٣ 1 2 3",
        "sendrtr 123 9",
        "sendrtr 123 2 1 2",
    ],
)
def test_a_wrong_send_is_left_out_with_a_reason(text: str) -> None:
    with pytest.raises(InputError):
        words.to_frame(text.split())


@given(st.lists(st.binary(max_size=60), max_size=8))
@settings(max_examples=300, deadline=None)
def test_any_bytes_in_any_pieces_are_split(pieces: list[bytes]) -> None:
    rest = b""
    for piece in pieces:
        elements, rest, rubbish = words.split(rest + piece)
        assert rubbish >= 0 and len(rest) <= words.LONGEST
        for element in elements:
            with suppress(InputError):
                words.to_frame(element or ["send"])


def test_a_client_that_does_not_read_is_disconnected_and_holds_nobody_up(
    raw: Callable[..., socket.socket],
    client: Callable[..., can.BusABC],
    open_bus: Opener,
    server: Server,
    caplog: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "BACKLOG", 1 << 16)
    lazy, tool, bus = raw(), client(), open_bus()
    longest = 0.0
    sent = received = 0
    while server.clients == 2 and sent < 200_000:
        for _ in range(200):
            began = time.monotonic()
            bus.send(frame(0x700, sent.to_bytes(8, "big")))
            longest = max(longest, time.monotonic() - began)
            sent += 1
        while received < sent:  # this one keeps up
            message = tool.recv(10.0)
            assert message is not None and int.from_bytes(message.data, "big") == received
            received += 1
    assert server.clients == 1
    assert "it did not read" in caplog.text
    assert longest < STALL / 2, "as long as the hub would wait for the one who does not read"
    lazy.close()


def test_a_client_that_leaves_in_the_middle(
    raw: Callable[..., socket.socket], client: Callable[..., can.BusABC], open_bus: Opener, server: Server
) -> None:
    bus, tool = open_bus(), client()
    for _ in range(20):
        sock = raw()
        sock.sendall(b"< send 123")
        bus.send(frame(0x700))
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # a reset
        sock.close()
        bus.send(frame(0x700))
    assert len(drain(tool)) == 40
    wait_for(lambda: server.clients == 1)
    assert server.alive()


def test_too_many_clients_are_turned_away(raw: Callable[..., socket.socket], server: Server) -> None:
    for _ in range(module.CLIENTS):
        raw(in_raw_mode=False)
    with socket.create_connection(server.address) as sock:
        assert sock.recv(100) == b""
    assert server.clients == module.CLIENTS


def test_a_killed_hub_is_reported_and_clients_stay(hub: Callable[..., Any], open_bus: Opener) -> None:
    process = hub("test")
    faults: list[Fault] = []
    with (
        Server(partial(open_any, "rds", "test"), "test", port=0, on_error=faults.append) as server,
        can.Bus(
            interface="socketcand", channel="test", host="127.0.0.1", port=server.address[1], tcp_tune=True
        ) as tool,
    ):
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        bus = open_bus()

        def arrives() -> bool:
            bus.send(frame(0x700))
            return tool.recv(0.05) is not None

        wait_for(arrives, 10.0)
        assert len(faults) == 1 and server.alive()


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.1.1", "::", "example.org", ""])
def test_only_loopback_is_served(host: str) -> None:
    with pytest.raises(InputError, match="loopback"):
        Server(partial(open_any, "rds", "test"), "test", host=host)


def test_the_port_is_free_again_and_the_bus_left(open_bus: Opener) -> None:
    open_bus()
    logging.getLogger("can").setLevel(logging.WARNING)
    with Server(partial(open_any, "rds", "test"), "test", port=0) as server:
        port = server.address[1]
        with pytest.raises(OSError):
            Server(partial(open_any, "rds", "test"), "test", port=port).start()
    with Server(partial(open_any, "rds", "test"), "test", port=port):
        pass
