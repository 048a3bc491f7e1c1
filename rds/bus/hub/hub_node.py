"""One connection of the hub: its buffers and what it has said about itself."""

from __future__ import annotations

import contextlib
import socket
import time
from enum import Enum, auto

from rds.bus.hub import wire

# Few frames at a time, so that a node that floods the bus delays the others' frames by little.
_READ = 16 * wire.RECORD  # bytes
_WRITE = 4096 * wire.RECORD  # bytes


class State(Enum):
    """The life of a connection."""

    GREETING = auto()  # it has not said all about itself yet
    JOINED = auto()  # it is a node of the bus
    ASKING = auto()  # it is no node, and asks and tells the hub things
    LEAVING = auto()  # it gets what is on its way and then the reason
    GONE = auto()


class Node:
    """A connection; `out` ends on a whole record and may begin within one that is half sent."""

    __slots__ = (
        "at_end",
        "dirty",
        "fd",
        "filters",
        "hello",
        "hung_up",
        "inbox",
        "moved_at",
        "number",
        "out",
        "paused",
        "question",
        "receive_own",
        "settings",
        "sock",
        "state",
        "waiting",
    )

    def __init__(self, sock: socket.socket, now: int):
        self.sock = sock
        self.fd = sock.fileno()
        self.state = State.GREETING
        self.number = 0
        self.hello: wire.Hello | None = None
        self.settings: wire.Settings | None = None
        self.receive_own = False
        self.filters: list[wire.Filter] = []
        self.inbox = b""  # the beginning of a record whose end is not here yet
        self.out = bytearray()
        self.moved_at = now  # ns, when it took something last
        self.waiting = False  # until its socket can take more
        self.dirty = False  # `out` has grown in this round
        self.hung_up = False  # ended while nothing could be read from it
        self.at_end = False  # nothing more will come
        self.paused = False  # its controller is full; what it sends waits in its socket
        self.question = b""  # the beginning of one whose end is not here yet

    def receive(self) -> list[bytes]:
        """The whole records that have come; OSError if there are none or the connection broke."""
        data = self.sock.recv(_READ)
        if not data:
            self.at_end = True
            return []
        if self.inbox:
            data = self.inbox + data
            self.inbox = b""
        size = wire.RECORD
        if len(data) == size:
            return [data]
        whole = len(data) - len(data) % size
        if whole != len(data):
            self.inbox = data[whole:]
        return [data[i : i + size] for i in range(0, whole, size)]

    def send(self) -> None:
        """Send as much of `out` as the socket takes; OSError if the connection broke."""
        out = self.out
        while out:
            try:
                sent = self.sock.send(out if len(out) <= _WRITE else out[:_WRITE])
            except BlockingIOError:
                return
            self.moved_at = time.monotonic_ns()
            if sent == len(out):
                out.clear()
            else:
                del out[:sent]

    def greet(self, record: bytes, token: bytes) -> bool:
        """Take a record of the greeting; true when it is complete. WireError if it isn't one."""
        if self.hello is None:
            hello = wire.decode_hello(record)
            if not _is_same(hello.token, token):
                raise wire.WireError("the token is wrong: not the user who started the hub")
            self.hello = hello
            self.receive_own = hello.receive_own
        elif self.hello.settings and self.settings is None:
            self.settings = wire.decode_settings(record)
        else:
            self.filters += wire.decode_filters(record)
        if self.hello.settings and self.settings is None:
            return False
        return len(self.filters) >= self.hello.filters

    def wants(self, identifier: int, extended: bool) -> bool:
        """Whether its filters let a frame pass; without filters all do."""
        return not self.filters or any(f.passes(identifier, extended) for f in self.filters)

    def say_goodbye(self, reason: str) -> None:
        """Drop what waits, except the rest of a half-sent record, and put the reason behind it."""
        del self.out[len(self.out) % wire.RECORD :]
        self.out += wire.encode_goodbye(reason)
        self.waiting = True
        self.state = State.LEAVING
        with contextlib.suppress(OSError):  # it may have gone already
            self.sock.shutdown(socket.SHUT_RD)  # its next send fails at its end


def _is_same(said: bytes, token: bytes) -> bool:
    """Whether somebody knows the token; how long this takes tells nothing about it."""
    if not any(token):  # the transport itself tells who is there
        return said == token
    from hmac import compare_digest  # some ms, which a hub's start can do without

    return compare_digest(said, token)
