"""Whoever is not the user of a bus: other users of the computer, web pages, other computers."""

from __future__ import annotations

import os
import socket
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import can
import pytest

from rds.bus.hub import hub_nodes
from rds.bus.hub.address import Address
from rds.bus.tools.link import open_bus as open_any
from rds.core.errors import InputError

from .conftest import FORK

Opener = Callable[..., can.BusABC]
NOBODY = 65534
AS_ROOT = pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can become another user"
)
FRAME = can.Message(arbitration_id=0x790, is_extended_id=False, data=b"\x01")


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def as_nobody(path: str, answer: Any) -> None:
    os.setgid(NOBODY)
    os.setuid(NOBODY)
    sock = socket.socket(socket.AF_UNIX)
    sock.settimeout(20.0)
    try:
        sock.connect(path)
        with suppress(BrokenPipeError):
            sock.sendall(bytes(80))
        answer.put(repr(sock.recv(80)))
    except OSError as error:
        answer.put(type(error).__name__)


def tries(path: Path) -> str:
    """What a process of another user gets from the socket."""
    answer = FORK.SimpleQueue()
    process = FORK.Process(target=as_nobody, args=(str(path), answer))
    process.start()
    said: str = answer.get()
    process.join()
    return said


def test_what_a_hub_leaves_in_the_directory_is_its_users_alone(
    open_bus: Opener, runtime_directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    open_bus(bitrate=500_000)
    directory = runtime_directory / "rds"
    assert mode(directory) == 0o700
    found = {path.name: mode(path) for path in directory.iterdir()}
    assert {"test.sock", "test.lock", "test.states"} <= set(found)
    assert set(found.values()) == {0o600}
    monkeypatch.setenv("RDS_BUS_TRANSPORT", "tcp")
    old = os.umask(0)
    try:
        open_bus("other")
    finally:
        os.umask(old)
    assert mode(directory / "other.tcp") == 0o600


@AS_ROOT
def test_another_user_does_not_reach_the_hub(open_bus: Opener, runtime_directory: Path) -> None:
    bus, other = open_bus(), open_bus()
    path = runtime_directory / "rds" / "test.sock"
    assert tries(path) == "PermissionError"
    runtime_directory.chmod(0o755)
    path.parent.chmod(0o755)
    assert tries(path) == "PermissionError", "the socket's own mode keeps them out"
    path.chmod(0o666)
    assert tries(path) in ("b''", "ConnectionResetError"), "the hub asks whose process it is"
    path.parent.chmod(0o700)
    bus.send(FRAME)
    found = other.recv(10.0)
    assert found is not None and found.data == FRAME.data


def test_a_hub_of_another_user_is_not_joined(open_bus: Opener, monkeypatch: pytest.MonkeyPatch) -> None:
    open_bus()
    monkeypatch.setattr("rds.bus.hub.address.os.geteuid", lambda: os.getuid() + 1)
    with pytest.raises(PermissionError, match="process of another user"):
        Address("test").connect(5.0)


def test_over_tcp_a_web_page_and_idle_strangers_harm_nobody(
    open_bus: Opener, runtime_directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RDS_BUS_TRANSPORT", "tcp")
    bus = open_bus()
    port = int((runtime_directory / "rds" / "test.tcp").read_bytes().split()[0])
    with socket.create_connection(("127.0.0.1", port), timeout=20.0) as page:
        page.sendall(b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\n".ljust(800, b"x"))
        said = b""
        with suppress(ConnectionError):
            while more := page.recv(4096):
                said += more
        assert b"the first record is of kind" in said
    idle = [socket.create_connection(("127.0.0.1", port), timeout=20.0) for _ in range(hub_nodes.STRANGERS + 1)]
    other = open_bus()
    bus.send(FRAME)
    assert other.recv(10.0) is not None
    assert b"no hello came" in idle[0].recv(4096)
    for sock in idle:
        sock.close()


@pytest.mark.parametrize(
    "interface, channel, options",
    [
        ("udp_multicast", "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173", {}),
        ("socketcand", "can0", {"host": "192.168.1.7", "port": 29536}),
        ("socketcand", "can0", {"host": "lab-server", "port": 29536}),
        ("slcan", "socket://192.168.1.7:3333", {}),
        ("remote", "ws://10.0.0.1:54701/", {}),
    ],
)
def test_a_bus_beyond_this_computer_has_to_be_wanted(
    interface: str, channel: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[dict[str, Any]] = []
    monkeypatch.setattr("can.Bus", lambda **given: opened.append(given) or Mock())
    with pytest.raises(InputError, match="beyond_this_computer = true"):
        open_any(interface, channel, **options)
    with pytest.raises(InputError, match="must be true or false"):
        open_any(interface, channel, **options, beyond_this_computer="yes")
    assert not opened
    open_any(interface, channel, **options, beyond_this_computer=True)
    assert "beyond_this_computer" not in opened[0] and opened[0]["channel"] == channel


def test_a_host_in_python_cans_own_file_counts_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "can.ini"
    file.write_text("[default]\nhost = 192.168.1.7\nport = 29536\n")
    monkeypatch.setattr("can.util.CONFIG_FILES", [str(file)])
    with pytest.raises(InputError, match=r"192\.168\.1\.7., beyond this computer"):
        open_any("socketcand", "can0")


@pytest.mark.parametrize(
    "interface, channel, options",
    [
        ("socketcand", "can0", {"host": "127.0.0.1", "port": 1}),
        ("socketcand", "can0", {"host": "localhost", "port": 1}),
        ("slcan", "socket://127.0.0.1:3333", {}),
        ("slcan", "/dev/ttyUSB0", {}),
        ("socketcan", "can0", {}),
        ("virtual", "x", {}),
    ],
)
def test_what_stays_on_this_computer_needs_no_word(
    interface: str, channel: str, options: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[dict[str, Any]] = []
    monkeypatch.setattr("can.Bus", lambda **given: opened.append(given) or Mock())
    open_any(interface, channel, **options)
    assert opened
