"""A node's connection to the hub of its channel, which is started if there is none. No python-can here."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rds.bus.hub import wire
from rds.bus.hub.address import Address
from rds.core.exit_code import how_it_ended

PATIENCE = 10.0  # s for a hub to start and to answer
_RETRY = 0.002  # s between looks at a hub that somebody else is starting or that is just ending


class Connection(NamedTuple):
    """A node on the bus: its socket (blocking), its number there and the hub's process id."""

    sock: socket.socket
    node: int
    hub_pid: int
    bitrate: int = 0  # bit/s; 0: the bus has no bit timing
    data_bitrate: int = 0


def join(
    channel: str,
    receive_own: bool,
    filters: Sequence[wire.Filter],
    settings: wire.Settings,
    timeout: float = PATIENCE,
) -> Connection:
    """Become a node of `channel`; start its hub if there is none.

    The first node's settings say whether the bus has bit timing. ValueError for a bad channel name, OSError
    (TimeoutError, PermissionError, ConnectionRefusedError...) if there is no way in.
    """
    address = Address(channel)
    deadline = time.monotonic() + timeout
    hello = wire.Hello(wire.JOIN, receive_own, len(filters), 0, b"", True)
    greeting = wire.encode_settings(settings) + wire.encode_filters(filters)
    while True:
        connection = _attempt(address, hello, greeting, deadline)
        if connection is not None:
            return connection
        lock = address.lock()
        if lock is not None:  # no hub lives, and nobody else starts one
            if hasattr(os, "fork"):
                try:
                    _start_hub(address, lock, deadline)
                finally:
                    os.close(lock)
            else:
                os.close(lock)
                _start_hub_on_windows(address, deadline)
                if time.monotonic() > deadline:
                    raise TimeoutError(f"the hub of channel {channel!r} did not start in time")
        elif time.monotonic() > deadline:
            raise TimeoutError(
                f"channel {channel!r} has a hub that does not listen; end process {address.holder() or 'unknown'}"
            )
        else:
            time.sleep(_RETRY)


def retune(channel: str, node: int, filters: Sequence[wire.Filter], timeout: float = PATIENCE) -> None:
    """Give the node with this number other filters; they hold for every frame sent after this call.

    By a connection of its own, so that the answer doesn't queue behind frames. OSError if the hub doesn't do it.
    """
    hello = wire.Hello(wire.RETUNE, False, len(filters), node, b"")
    connection = _attempt(Address(channel), hello, wire.encode_filters(filters), time.monotonic() + timeout)
    if connection is None:
        raise ConnectionError(f"the hub of channel {channel!r} has ended")
    connection.sock.close()


def visit(channel: str, timeout: float = PATIENCE) -> Connection | None:
    """A connection for questions to the hub (see hub_requests.py), which is no node; None if the channel has no hub."""
    hello = wire.Hello(wire.ASK, False, 0, 0, b"")
    connection = _attempt(Address(channel), hello, b"", time.monotonic() + timeout)
    if connection is not None:
        connection.sock.settimeout(timeout)
    return connection


def ask(connection: Connection, question: str) -> str:
    """The hub's answer to `question`. OSError if the hub does not answer, or has ended."""
    connection.sock.sendall(wire.encode_text(question))
    answer, more = b"", True
    while more:
        record = _receive(connection.sock)
        if not record:
            raise ConnectionError("the hub has ended")
        try:
            part, more = wire.decode_part(record)
        except wire.WireError as error:
            raise ConnectionRefusedError(str(error)) from error
        answer += part
    return answer.decode()


def _attempt(address: Address, hello: wire.Hello, rest: bytes, deadline: float) -> Connection | None:
    """Connect and greet; None if there is no hub or it is just ending."""
    try:
        sock = address.connect(max(0.01, deadline - time.monotonic()))
    except (FileNotFoundError, ConnectionError):
        return None
    try:
        sock.sendall(wire.encode_hello(hello._replace(token=address.token)) + rest)
        answer = _receive(sock)
        if not answer:
            sock.close()
            return None
        welcome = wire.decode_welcome(answer)
        sock.settimeout(None)
        return Connection(sock, *welcome)
    except ConnectionError:
        sock.close()
        return None
    except TimeoutError:
        sock.close()
        raise TimeoutError(
            f"the hub of channel {address.channel!r} does not answer; is process {address.holder()} stopped?"
        ) from None
    except wire.WireError as error:
        sock.close()
        raise ConnectionRefusedError(f"the hub of channel {address.channel!r} refused: {error}") from error


def _receive(sock: socket.socket) -> bytes:
    """One record, or nothing if the other end has gone."""
    data = b""
    while len(data) < wire.RECORD:
        more = sock.recv(wire.RECORD - len(data))
        if not more:
            return b""
        data += more
    return data


def _start_hub(address: Address, lock: int, deadline: float) -> None:
    """Start the hub with the channel's lock in its hand; return when it listens."""
    process = subprocess.Popen(
        [*_command(address), "--lock", str(lock)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        env=_environment(),
        pass_fds=(lock,),
        start_new_session=True,
    )
    try:
        _, text = process.communicate(timeout=max(0.1, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise TimeoutError(f"the hub of channel {address.channel!r} did not start in time") from None
    if process.returncode != 0:
        why = text.decode(errors="replace").strip() or f"it {how_it_ended(process.returncode)}"
        raise OSError(f"the hub of channel {address.channel!r} did not start: {why}")


def _start_hub_on_windows(address: Address, deadline: float) -> None:
    """The same where no descriptor is handed on and no process forks: the hub locks, its file says that it listens."""
    detached = 0x00000008 | 0x00000200  # DETACHED_PROCESS | CREATE_NEW_PROCESS_GROUP
    process = subprocess.Popen(_command(address), stdin=subprocess.DEVNULL, env=_environment(), creationflags=detached)
    while process.poll() is None and not address.path.exists() and time.monotonic() < deadline:
        time.sleep(_RETRY)


def _command(address: Address) -> list[str]:
    # -S: no site packages needed; -P: a student's socket.py in the current directory must not be imported
    return [sys.executable, "-S", "-P", "-m", "rds.bus.hub.hub", address.channel, "--detach"]


def _environment() -> dict[str, str]:
    root = str(Path(__file__).resolve().parents[3])  # of this package, wherever it was imported from
    return dict(os.environ, PYTHONPATH=os.pathsep.join([root, os.environ.get("PYTHONPATH", "")]))
