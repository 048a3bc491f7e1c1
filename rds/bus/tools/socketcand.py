"""Offers a bus to third-party tools by the protocol of socketcand, on this machine's loopback address only.

One node on the bus serves all clients; what one client sends, the others see. Of the protocol, `open`, `rawmode`,
`bcmmode` (in which only `send`, `sendrtr` and `echo` are understood), `send`, `sendrtr` and `echo` are spoken, and
frames, remote frames (`rtr`) and error frames told. CAN FD frames have no words there: they are left out, which the
log says once for each client.

TCP tells no user of a computer from another, and a web page may send to any of its ports. So the name by which
clients open the bus ends in a word that is new with each server and that only its user knows; every client can say it,
for every client says a bus's name. Nothing is shown, and nothing taken, before that. A client is disconnected at the
first byte that is not the protocol's, when it does not open the bus in `GREETING` s, and when it is told nothing
(`bcmmode`) and says nothing for `SILENCE` s. While as many as can be are connected, a new one gets the place of the
first that has not opened the bus.

A client that does not read is disconnected when `BACKLOG` bytes wait for it; the bus never waits for a client. An
element that is not understood is answered by an error or, in a `send`, left out with a line in the log, as socketcand
does.

Our own, because python-can's `socketcand` is a client alone.
"""

from __future__ import annotations

import hmac
import logging
import math
import secrets
import selectors
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import can

from rds.bus.tools import socketcand_words as words
from rds.bus.tools.live_machine import acts_on_machine
from rds.bus.tools.receiver import Fault, Receiver
from rds.core.errors import InputError
from rds.core.loopback import is_loopback

LOG = logging.getLogger(__name__)

PORT = 29536
BACKLOG = 1 << 20  # bytes: some 20,000 frames, a second of the busiest bus
CLIENTS = 32
GREETING = 5.0  # s for a client to open the bus
SILENCE = 600.0  # s that a client may say nothing while it is told nothing
_WORD = 16  # bytes of chance in the word: nobody guesses it
_LOOK = 0.2  # s
_SEND = 0.05  # s that the bus may take for a frame; the other clients wait meanwhile
_HOLD = 0.05  # s from the answer to `rawmode` to the first frame: python-can's client takes both for one, and fails
_ROUND = 1000  # frames that are told before clients are listened to again
_SAID = 20  # complaints about one client that go to the log


class Server:
    """Serves the bus that `open_bus` opens as `channel` from start() (or `with`) to stop().

    `on_error` gets the bus's faults; it is opened again after them. Unless `with_commands`, only frames that certainly
    do nothing to a machine are taken from clients (live_machine.py). `port` 0 takes a free one: see `address`. Clients
    open the bus by the name `opens`, which is `channel` and a secret word.

    Raises InputError for an address that is not this machine's loopback, OSError if the port is taken, and what
    `open_bus` raises.
    """

    def __init__(
        self,
        open_bus: Callable[[], can.BusABC],
        channel: str,
        *,
        host: str = "127.0.0.1",
        port: int = PORT,
        with_commands: bool = False,
        on_error: Callable[[Fault], Any] = lambda fault: None,
    ):
        _check_loopback(host)
        if not 0 <= port <= 65535:
            raise InputError(f"port {port} must be from 0 (any that is free) to 65535")
        self._channel = " ".join(channel.split())
        self.opens = f"{self._channel}.{secrets.token_hex(_WORD)}"
        self._host, self._port = host, port
        self._with_commands = with_commands
        self._receiver = Receiver(open_bus, on_error, name=f"bus {channel}")
        self._frames = self._receiver.subscribe(name="the socketcand server", wake=self._wake)
        self._clients: dict[socket.socket, _Client] = {}
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="socketcand server", daemon=True)
        self._selector = selectors.DefaultSelector()
        self._waker, self._woken = socket.socketpair()
        self._listener: socket.socket | None = None
        self.address = (host, port)

    def start(self) -> None:
        """Listen, and join the bus."""
        family = socket.AF_INET6 if ":" in self._host else socket.AF_INET
        self._listener = socket.create_server((self._host, self._port), family=family, backlog=CLIENTS)
        self.address = self._listener.getsockname()[:2]
        try:
            self._receiver.start()
        except BaseException:
            self._listener.close()
            self._waker.close()
            self._woken.close()
            raise
        for sock in (self._listener, self._woken, self._waker):
            sock.setblocking(False)
        self._selector.register(self._listener, selectors.EVENT_READ, self._accept)
        self._selector.register(self._woken, selectors.EVENT_READ, self._spread)
        self._thread.start()

    def stop(self) -> None:
        """Disconnect everybody and leave the bus."""
        self._stopping.set()
        self._wake()
        if self._thread.ident is not None:
            self._thread.join(5.0)
        self._receiver.stop()

    def alive(self) -> bool:
        """Whether it serves, and its receiver reads the bus or is about to open it again."""
        return self._thread.is_alive() and self._receiver.alive()

    @property
    def clients(self) -> int:
        """How many are connected."""
        return len(self._clients)

    def __enter__(self) -> Server:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    # --- the serving thread

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                for key, events in self._selector.select(self._patience()):
                    key.data(events)
                self._spread(0)
                for client in list(self._clients.values()):
                    if client.held and not client.is_held():
                        client.held = 0.0
                        self._flush(client)
                    if time.monotonic() > client.due:
                        self._drop(client, "it has not opened the bus" if not client.open else "it says nothing")
        except BaseException:
            LOG.exception("the socketcand server ended by an exception")
        finally:
            for client in list(self._clients.values()):
                self._drop(client, "the server ends")
            for sock in (self._listener, self._waker, self._woken):
                if sock is not None:
                    sock.close()
            self._selector.close()

    def _patience(self) -> float:
        if self._frames.waiting:
            return 0.0
        return 0.01 if any(client.held for client in self._clients.values()) else _LOOK

    def _wake(self) -> None:
        with suppress(OSError):  # full: it is about to wake; closed: it has ended
            self._waker.send(b"\0")

    def _accept(self, events: int) -> None:
        assert self._listener is not None
        try:
            sock, peer = self._listener.accept()
        except OSError as error:
            LOG.warning("a client could not be accepted: %s", error)
            return
        strangers = [client for client in self._clients.values() if not client.open]
        if len(self._clients) >= CLIENTS and strangers:
            self._drop(strangers[0], f"it has not opened the bus, and {CLIENTS} are connected")
        if len(self._clients) >= CLIENTS:
            LOG.warning("client %s turned away: %d are connected", peer[1], CLIENTS)
            sock.close()
            return
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        client = _Client(sock, f"client {peer[1]}")
        self._clients[sock] = client
        self._selector.register(sock, selectors.EVENT_READ, lambda events: self._serve(client, events))
        LOG.info("%s has connected", client.name)
        self._say(client, b"< hi >")

    def _spread(self, events: int) -> None:
        """Tell all clients in RAW mode what came over the bus."""
        if events:
            with suppress(OSError):
                self._woken.recv(4096)
        for _ in range(min(self._frames.waiting, _ROUND)):
            message = self._frames.get(0.0)
            if message is not None:
                self._tell(message)

    def _tell(self, message: can.Message, sender: _Client | None = None) -> None:
        text = words.to_text(message)
        for client in list(self._clients.values()):
            if not client.raw or client is sender:
                continue
            if text is not None:
                self._say(client, text)
            elif not client.misses_fd:
                client.misses_fd = True
                LOG.warning("%s does not get CAN FD frames: socketcand's protocol has none", client.name)

    def _say(self, client: _Client, text: bytes) -> None:
        waiting = bool(client.out)
        client.out += text
        if len(client.out) > BACKLOG:
            self._drop(client, f"it did not read, and {len(client.out)} bytes wait for it")
        elif not waiting and not client.is_held():
            self._flush(client)

    def _flush(self, client: _Client) -> None:
        try:
            sent = client.sock.send(client.out) if client.out else 0
            del client.out[:sent]
        except BlockingIOError:
            pass
        except OSError as error:
            self._drop(client, str(error))
            return
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.out else 0)
        if events != client.events:
            client.events = events
            self._selector.modify(client.sock, events, lambda events: self._serve(client, events))

    def _drop(self, client: _Client, why: str) -> None:
        if self._clients.pop(client.sock, None) is None:
            return
        LOG.log(logging.INFO if client.left else logging.WARNING, "%s is disconnected: %s", client.name, why)
        self._selector.unregister(client.sock)
        client.sock.close()

    # --- what clients say

    def _serve(self, client: _Client, events: int) -> None:
        if client.sock not in self._clients:
            return
        if events & selectors.EVENT_WRITE and not client.is_held():
            self._flush(client)
        if not events & selectors.EVENT_READ or client.sock not in self._clients:
            return
        try:
            received = client.sock.recv(4096)
        except BlockingIOError:
            return
        except OSError as error:
            self._drop(client, str(error))
            return
        client.left = not received
        if not received:
            self._drop(client, "it has left")
            return
        elements, client.rest, wrong = words.split(client.rest + received)
        for element in elements:
            if client.sock in self._clients:
                self._obey(client, element)
        if wrong:
            self._drop(client, wrong)

    def _obey(self, client: _Client, element: list[str]) -> None:
        verb = element[0] if element else ""
        if client.is_silent:
            client.due = time.monotonic() + SILENCE
        if verb == "echo" and len(element) == 1:
            self._say(client, b"< echo >")
        elif not client.open:
            self._open(client, element)
        elif verb in ("rawmode", "bcmmode") and len(element) == 1:
            self._say(client, b"< ok >")
            client.raw = verb == "rawmode"
            client.is_silent = not client.raw
            client.due = math.inf if client.raw else time.monotonic() + SILENCE
            if client.raw:
                client.held = time.monotonic() + _HOLD
        elif verb in ("send", "sendrtr"):
            self._send(client, element)
        else:
            self._complain(client, f"{' '.join(element)[:60]!r} is not spoken here")
            self._say(client, b"< error unknown command >")

    def _open(self, client: _Client, element: list[str]) -> None:
        name = " ".join(element[1:])
        if element[:1] != ["open"]:
            self._complain(client, f"{' '.join(element)[:60]!r} before a bus was opened")
            self._say(client, b"< error unknown command >")
        elif hmac.compare_digest(name.encode(), self.opens.encode()):
            client.open = client.is_silent = True  # the protocol's mode at first is BCM
            client.due = time.monotonic() + SILENCE
            self._say(client, b"< ok >")
        elif name == self._channel or name.startswith(f"{self._channel}."):
            self._say(client, b"< error could not open bus: open it by the name that the server said at its start >")
            self._drop(client, f"it does not know the word that belongs to bus {self._channel!r}")
        else:
            self._say(client, b"< error could not open bus >")
            self._drop(client, f"there is no bus {name[:60]!r}, but {self._channel!r}")

    def _send(self, client: _Client, element: list[str]) -> None:
        try:
            message = words.to_frame(element)
        except InputError as error:
            self._complain(client, f"a frame is left out: {error}")
            return
        acts = acts_on_machine(message)
        if acts is not None and not self._with_commands:
            self._complain(client, f"frame {message.arbitration_id:#05x} is left out: it {acts}; see --with-commands")
            return
        bus = self._receiver.bus
        try:
            if bus is None:
                raise can.CanOperationError("the bus has failed and is opened again")
            bus.send(message, _SEND)
        except (can.CanError, OSError, ValueError) as error:
            self._complain(client, f"a frame is left out: {error}")
            return
        message.timestamp = time.time()
        self._tell(message, client)

    @staticmethod
    def _complain(client: _Client, what: str) -> None:
        client.complaints += 1
        if client.complaints <= _SAID:
            LOG.warning("%s: %s", client.name, what)
        if client.complaints == _SAID:
            LOG.warning("%s: no more is said about this client", client.name)


class _Client:
    """A connection and what it has asked for."""

    def __init__(self, sock: socket.socket, name: str):
        self.sock = sock
        self.name = name
        self.open = False  # it has opened the bus, so its user is the server's
        self.due = time.monotonic() + GREETING  # s, monotonic: when it is disconnected unless it says more
        self.is_silent = False  # it is told nothing; it may say something
        self.raw = False  # it wants all frames
        self.left = False
        self.rest = b""  # the beginning of an element
        self.out = bytearray()
        self.events = selectors.EVENT_READ
        self.complaints = 0
        self.misses_fd = False
        self.held = 0.0  # s, monotonic: until then nothing is sent

    def is_held(self) -> bool:
        """Whether it shall get nothing yet."""
        return self.held > time.monotonic()


def _check_loopback(host: str) -> None:
    if not is_loopback(host):
        raise InputError(
            f"address {host!r} is not this machine's loopback; the protocol encrypts nothing, its word neither, so "
            "serve 127.0.0.1 and reach it from elsewhere by an SSH tunnel (ssh -L)"
        )
