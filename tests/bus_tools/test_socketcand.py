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
from hypothesis import given, settings
from hypothesis import strategies as st
from waiting import wait_for

from bus_tools.made_frames import frame, kept, of_every_kind
from rds.bus.hub.hub_loop import STALL
from rds.bus.tools import socketcand as module
from rds.bus.tools import socketcand_words as words
from rds.bus.tools.link import open_bus as open_any
from rds.bus.tools.live_machine import harmless_identifiers
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

    def opener() -> can.BusABC:
        bus = can.Bus(
            interface="socketcand",
            channel=server.opens,
            host="127.0.0.1",
            port=server.address[1],
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
            sock.sendall(f"< open {server.opens} >< rawmode >".encode())
            assert [sock.recv(6) for _ in range(2)] == [b"< ok >"] * 2
        return sock

    yield opener
    for sock in opened:
        sock.close()


def drain(bus: can.BusABC, quiet: float = 0.3) -> list[can.Message]:
    return list(iter(lambda: bus.recv(quiet), None))


def test_frames_both_ways(client: Callable[..., can.BusABC], open_bus: Opener) -> None:
    bus, tool = open_bus(), client()
    for message in (frame(0x7FF, bytes(range(8))), frame(0x790), frame(0x780, b"\x01")):
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
    one.send(frame(0x790, b"\x01"))
    found = two.recv(2.0)
    assert found is not None and found.data == b"\x01"


def test_a_client_that_joins_a_busy_bus(client: Callable[..., can.BusABC], open_bus: Opener) -> None:
    bus = open_bus()
    task = bus.send_periodic(frame(0x790, bytes(8)), 0.0005)
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
    tool.send(frame(0x790, bytes(64), is_fd=True))  # sent by a client that knows no better
    tool.send(frame(0x790, is_remote_frame=True, dlc=4))
    assert not drain(bus)
    assert "no CAN FD frames" in caplog.text and "asked for by sendrtr" in caplog.text


def test_frames_that_act_on_a_machine_are_not_taken(
    client: Callable[..., can.BusABC], raw: Callable[..., socket.socket], open_bus: Opener, caplog: Any
) -> None:
    bus, tool = open_bus(), client()
    for message in (frame(0x010, bytes(8)), frame(0x013, b"\x08"), frame(0x790, b"\x01", is_extended_id=True)):
        tool.send(message)
    raw().sendall(b"< sendrtr 790 4 >")
    tool.send(frame(0x790))
    assert [message.arbitration_id for message in drain(bus)] == [0x790]
    for told in (
        "frame 0x010 is left out: it sets voltages; see --with-commands",
        "frame 0x013 is left out: it calls modules, or resets their emergency stop",
        "frame 0x790 is left out: it has an extended identifier",
        "frame 0x790 is left out: it is a remote frame",
    ):
        assert told in caplog.text


def test_of_every_frame_a_program_passes_exactly_those(open_bus: Opener) -> None:
    witness = open_bus()
    sent = [f"< send {i:03X} {length} {'8 ' * length}>" for i in range(0x800) for length in (0, 1, 8)]
    sent += [f"< sendrtr {i:03X} 1 >" for i in range(0x800)] + [f"< send {i:08X} 1 8 >" for i in range(0x800)]
    with (
        Server(partial(open_any, "rds", "test"), "test", port=0) as server,
        socket.create_connection(server.address) as client,
    ):
        client.sendall(f"< open {server.opens} >{''.join(sent)}".encode())
        wanted = [(i, bytes((8,)) * length) for i in harmless_identifiers() for length in (0, 1, 8)]
        client.sendall(b"< echo >")
        client.settimeout(30.0)
        said = b""
        while not said.endswith(b"< echo >"):
            said += client.recv(4096)
        found = [witness.recv(10.0) for _ in wanted]
    assert [(m.arbitration_id, bytes(m.data)) for m in found if m and not m.is_extended_id] == wanted
    assert witness.recv(0.0) is None


def test_with_commands_they_are(open_bus: Opener) -> None:
    bus = open_bus()
    with (
        Server(partial(open_any, "rds", "test"), "test", port=0, with_commands=True) as server,
        can.Bus(
            interface="socketcand", channel=server.opens, host="127.0.0.1", port=server.address[1], tcp_tune=True
        ) as tool,
    ):
        for message in (frame(0x010, bytes(8)), frame(0x123, b"\x01", is_extended_id=True)):
            tool.send(message)
            found = bus.recv(10.0)
            assert found is not None and kept(found) == kept(message)
        with socket.create_connection(server.address) as plain:
            plain.sendall(f"< open {server.opens} >< sendrtr 790 4 >".encode())
            found = bus.recv(10.0)
            assert found is not None and found.is_remote_frame and found.dlc == 4


def test_echo_in_every_state_and_modes(raw: Callable[..., socket.socket], server: Server) -> None:
    sock = raw(in_raw_mode=False)
    for sent, answer in (
        (b"< echo >", b"< echo >"),
        (b"<echo>\n", b"< echo >"),
        (b"< rawmode >", b"< error unknown command >"),
        (b"<>< >", b"< error unknown command >" * 2),
        (f"< open {server.opens} >".encode(), b"< ok >"),
        (b"< echo >", b"< echo >"),
        (b"< bcmmode >", b"< ok >"),
        (b"< subscribe 0 0 123 >", b"< error unknown command >"),
    ):
        sock.sendall(sent)
        assert take(sock, len(answer)) == answer
    for byte in b"< echo >":
        sock.sendall(bytes([byte]))
    assert sock.recv(100) == b"< echo >"


def take(sock: socket.socket, most: int = 4096) -> bytes:
    """So many bytes, or all until the other end has gone."""
    found = b""
    while len(found) < most:
        try:
            more = sock.recv(most - len(found))
        except ConnectionError:  # what we sent was not read
            break
        if not more:
            break
        found += more
    return found


def test_another_bus_is_refused(raw: Callable[..., socket.socket]) -> None:
    sock = raw(in_raw_mode=False)
    sock.sendall(b"< open can0 >")
    assert take(sock) == b"< error could not open bus >"


@pytest.mark.parametrize("with_commands", [False, True])
def test_without_the_word_nothing_is_seen_and_nothing_sent(with_commands: bool, open_bus: Opener, caplog: Any) -> None:
    bus = open_bus()
    task = bus.send_periodic(frame(0x790, b"secret"), 0.001)
    try:
        with Server(partial(open_any, "rds", "test"), "test", port=0, with_commands=with_commands) as server:
            wrong = "test." + "0" * (len(server.opens) - len("test."))
            for name in ("test", "test.", wrong, server.opens[:-1], server.opens + "0"):
                with socket.create_connection(server.address) as sock:
                    sock.settimeout(5.0)
                    sock.sendall(f"< open {name} >< rawmode >< send 010 8 0 40 0 0 0 0 0 0 >".encode())
                    told = take(sock)
                assert told.startswith(b"< hi >< error could not open bus: ") and b"frame" not in told
                assert server.opens.encode() not in told
            with pytest.raises(can.CanError, match="the name that the server said"):
                can.Bus(interface="socketcand", channel="test", host="127.0.0.1", port=server.address[1])
            with socket.create_connection(server.address) as sock:
                sock.sendall(b"< send 010 8 0 40 0 0 0 0 0 0 >< rawmode >")
                assert take(sock, len(b"< hi >") + 50) == b"< hi >" + b"< error unknown command >" * 2
    finally:
        task.stop()
    assert not drain(bus)
    assert "it does not know the word that belongs to bus 'test'" in caplog.text
    assert server.opens not in caplog.text


def test_each_server_has_a_word_of_its_own() -> None:
    servers = [Server(partial(open_any, "rds", "test"), "test", port=0) for _ in range(2)]
    assert servers[0].opens != servers[1].opens and len(servers[0].opens) >= len("test.") + 32


COMMAND = b"< send 010 8 0 40 0 0 0 0 0 0 >"


@pytest.mark.parametrize(
    "garbage, why",
    [
        (b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: text/plain\r\n\r\n", "a web page"),
        (b"GET / HTTP/1.1\r\nUpgrade: websocket\r\n\r\n", "a web page"),
        (b"< echo >GET / HTTP/1.1\r\n\r\n", "a web page"),
        (b"\x16\x03\x01\x02\0\x01\0", "byte b'\\x16'"),  # TLS
        (b"\0\xff" * 3000, "byte b'\\x00'"),
        (b"<" * 5000, "byte b'<'"),
        (b">" * 5000, "byte b'>'"),
        (b"x", "byte b'x'"),
        (b"< ec\0ho >", "byte b'\\x00'"),
        (b"< send\n010 >", "byte b'\\n'"),
        (b"< " + b"x" * 9000, "more than 256 characters"),
    ],
)
@pytest.mark.parametrize("opened", [False, True])
def test_the_first_byte_of_another_protocol_ends_a_connection(
    garbage: bytes, why: str, opened: bool, open_bus: Opener, caplog: Any
) -> None:
    bus = open_bus()
    with Server(partial(open_any, "rds", "test"), "test", port=0, with_commands=True) as server:
        name = server.opens.encode()
        with socket.create_connection(server.address) as bad:
            bad.settimeout(5.0)
            if opened:
                bad.sendall(b"< open %s >" % name)
                assert take(bad, 12) == b"< hi >< ok >"
            with suppress(ConnectionError):  # it may be gone before all is said
                bad.sendall(garbage + b" >< open %s >" % name + COMMAND)
            assert b"ok" not in take(bad)
        wait_for(lambda: server.clients == 0)
        assert why in caplog.text
        with can.Bus(interface="socketcand", channel=server.opens, host="127.0.0.1", port=server.address[1]) as tool:
            tool.send(frame(0x7FF))
            found = bus.recv(10.0)
            assert found is not None and found.arbitration_id == 0x7FF, "no command came before it"


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


@given(st.lists(st.binary(max_size=60) | st.sampled_from([b"< echo >", b"< send", b" 123 0 >"]), max_size=8))
@settings(max_examples=100, deadline=None)
def test_any_bytes_in_any_pieces_are_split(pieces: list[bytes]) -> None:
    rest = b""
    for piece in pieces:
        elements, rest, wrong = words.split(rest + piece)
        assert len(rest) < words.LONGEST and not (rest and wrong)
        for element in elements:
            with suppress(InputError):
                words.to_frame(element or ["send"])
        if wrong:
            break


@given(st.binary(max_size=30), st.integers(0, 30))
def test_where_the_pieces_are_cut_makes_no_difference(received: bytes, cut: int) -> None:
    whole = words.split(received)
    first, rest, wrong = words.split(received[:cut])
    if not wrong:
        second, rest, wrong = words.split(rest + received[cut:])
        assert (first + second, rest, bool(wrong)) == (whole[0], whole[1], bool(whole[2]))
    else:
        assert whole[2] and whole[0] == first


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
            bus.send(frame(0x790, sent.to_bytes(8, "big")))
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
        bus.send(frame(0x790))
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # a reset
        sock.close()
        bus.send(frame(0x790))
    assert len(drain(tool)) == 40
    wait_for(lambda: server.clients == 1)
    assert server.alive()


def test_too_many_clients_are_turned_away(raw: Callable[..., socket.socket], server: Server) -> None:
    for _ in range(module.CLIENTS):
        raw()
    with socket.create_connection(server.address) as sock:
        assert take(sock) == b""
    assert server.clients == module.CLIENTS


def test_those_that_open_nothing_lock_nobody_out(
    raw: Callable[..., socket.socket], client: Callable[..., can.BusABC], open_bus: Opener
) -> None:
    idle = [raw(in_raw_mode=False) for _ in range(module.CLIENTS)]
    tool = client()
    open_bus().send(frame(0x790))
    assert tool.recv(10.0) is not None
    assert take(idle[0]) == b"", "the first of them has gone"
    for sock in idle[1:]:
        sock.sendall(b"< echo >")
        assert sock.recv(100) == b"< echo >"


def test_who_opens_nothing_is_disconnected_after_a_while(
    raw: Callable[..., socket.socket], client: Callable[..., can.BusABC], open_bus: Opener, monkeypatch: Any
) -> None:
    monkeypatch.setattr(module, "GREETING", 0.3)
    tool, idle, talking = client(), raw(in_raw_mode=False), raw(in_raw_mode=False)
    with suppress(ConnectionError):
        while True:  # to say something else does not help
            talking.sendall(b"< echo >")
            if not talking.recv(100):
                break
    assert take(idle) == b""
    open_bus().send(frame(0x790))
    assert tool.recv(10.0) is not None, "who watches need not say anything"


def test_who_is_told_nothing_and_says_nothing_is_disconnected(
    raw: Callable[..., socket.socket], client: Callable[..., can.BusABC], open_bus: Opener, monkeypatch: Any
) -> None:
    monkeypatch.setattr(module, "SILENCE", 0.3)
    tool, silent = client(), raw()
    silent.sendall(b"< bcmmode >")
    assert take(silent) == b"< ok >"
    open_bus().send(frame(0x790))
    assert tool.recv(10.0) is not None


def test_a_killed_hub_is_reported_and_clients_stay(hub: Callable[..., Any], open_bus: Opener) -> None:
    process = hub("test")
    faults: list[Fault] = []
    with (
        Server(partial(open_any, "rds", "test"), "test", port=0, on_error=faults.append) as server,
        can.Bus(
            interface="socketcand", channel=server.opens, host="127.0.0.1", port=server.address[1], tcp_tune=True
        ) as tool,
    ):
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        bus = open_bus()

        def arrives() -> bool:
            bus.send(frame(0x790))
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
