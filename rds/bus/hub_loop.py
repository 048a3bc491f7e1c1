"""The hub's loop: every frame of every node to every other node. What it promises:

- one order: every node gets all frames in the same order, stamped by one clock that never steps;
- no loss: a frame that the hub has read reaches everybody. A node may lag by `QUEUE` bytes; then no further frame is
  carried until it has read, so senders wait;
- nobody waits for ever: a node that reads nothing for `stall` seconds while the others wait is let go and told so;
- garbage from one node ends that node's connection and nobody else's.
"""

from __future__ import annotations

import os
import socket
import sys
import time

from rds.bus import wire
from rds.bus.address import Address
from rds.bus.hub_node import Node, State
from rds.bus.medium import UntimedMedium
from rds.bus.poller import HANGUP, READ, WRITE, make_poller

# 65,536 frames: 13 s of a control loop with five frames per millisecond, and 5 s with thirteen. So a monitor that
# stands still never holds up such a loop: it is let go in the moment in which its queue is full.
QUEUE = 65536 * wire.RECORD  # bytes
STALL = 5.0  # s
LINGER = 3.0  # s the hub stays without a node
GREETING = 5.0  # s for a connection to say who it is
ROUTES = 8192  # kinds of frame whose receivers are remembered
SECOND = 1_000_000_000  # ns


class Hub:
    """Sockets in, sockets out; `medium` decides what goes when."""

    def __init__(self, address: Address, stall: float = STALL, linger: float = LINGER, queue: int = QUEUE):
        self._address = address
        self._stall = int(stall * SECOND)
        self._linger = int(linger * SECOND)
        self._queue = queue
        self._listener = address.listen()
        self._listener.setblocking(False)
        self._poller = make_poller()
        self._poller.register(self._listener.fileno(), READ)
        self._medium: UntimedMedium[Node] = UntimedMedium()
        self._nodes: dict[int, Node] = {}  # by file descriptor
        self._members: list[Node] = []  # those on the bus
        self._full: set[Node] = set()  # those for which the others wait
        self._holding = False
        self._routes: dict[bytes, tuple[Node, ...]] = {}  # by a frame's key
        self._last_number = 0
        self.noted = False  # something stands in the log that is worth keeping
        now = time.monotonic_ns()
        self._epoch = time.time_ns() - now
        self._left_at = now
        self._tidied_at = now

    def run(self) -> None:
        """Serve until nobody has been here for the linger time."""
        poll = self._poller.poll
        listening = self._listener.fileno()
        while True:
            for fd, events in poll(self._patience()):
                if fd == listening:
                    self._accept()
                    continue
                node = self._nodes.get(fd)
                if node is None:  # let go by an earlier event of this round
                    continue
                if events & WRITE:
                    self._flush(node)
                if events & ~WRITE and node.state is not State.GONE:
                    self._read(node, events)
            self._carry()
            now = time.monotonic_ns()
            if now - self._tidied_at > SECOND // 10:
                self._tidied_at = now
                if not self._tidy(now):
                    return

    def close(self, reason: str, remove_log: bool = False) -> None:
        """Tell everybody why, and let go of everything."""
        self._address.remove(remove_log)
        for node in list(self._nodes.values()):
            if node.state is State.JOINED:
                self._forget_member(node)
                node.say_goodbye(reason)
                self._flush(node)
            # one that was still greeting sees the end without a word, and looks for the next hub
            if node.state is not State.GONE:
                self._part(node)
        self._listener.close()
        self._poller.close()

    def _patience(self) -> float | None:
        """How long to sleep if nothing happens, s."""
        if self._full or len(self._members) != len(self._nodes) or not self._members:
            return 0.1
        return 1.0

    # --- connections

    def _accept(self) -> None:
        try:
            sock, _ = self._listener.accept()
        except OSError as error:  # it hung up again, or there are no descriptors left
            log(f"could not accept a connection: {error}")
            return
        sock.setblocking(False)
        if not self._address.unix:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        node = Node(sock, time.monotonic_ns())
        self._nodes[node.fd] = node
        self._poller.register(node.fd, READ)

    def _greet(self, node: Node, record: bytes) -> None:
        """Take one record of a connection that has not said all about itself yet."""
        if not node.greet(record, self._address.token):
            return
        hello = node.hello
        assert hello is not None
        if hello.purpose == wire.RETUNE:
            self._retune(node, hello.node)
            return
        self._last_number += 1
        node.number = self._last_number
        node.state = State.JOINED
        node.out += wire.encode_welcome(node.number, os.getpid())
        self._members.append(node)
        self._routes.clear()
        self._flush(node)

    def _retune(self, visitor: Node, number: int) -> None:
        """Give the filters that `visitor` has brought to the member with this number."""
        for member in self._members:
            if member.number == number:
                member.filters = visitor.filters
                self._routes.clear()
                visitor.out += wire.encode_welcome(number, os.getpid())
                visitor.state = State.LEAVING
                self._flush(visitor)
                return
        self._expel(visitor, f"there is no node {number} on this bus")

    def _expel(self, node: Node, reason: str) -> None:
        """End a connection; the node reads what is on its way to it and then the reason."""
        self.noted = True
        log(f"node {node.number} was let go: {reason}")
        was_member = node.state is State.JOINED
        node.say_goodbye(reason)
        if was_member:
            self._forget_member(node)
        self._watch(node)
        self._flush(node)

    def _part(self, node: Node) -> None:
        """The connection is over. Frames that it sent before stay in their place."""
        if node.state is State.JOINED:
            if node.inbox:
                self.noted = True
                log(f"node {node.number} ended in the middle of a frame")
            self._forget_member(node)
        node.state = State.GONE
        del self._nodes[node.fd]
        if not node.hung_up:
            self._poller.unregister(node.fd)
        node.sock.close()

    def _forget_member(self, node: Node) -> None:
        self._members.remove(node)
        self._full.discard(node)
        self._routes.clear()
        self._left_at = time.monotonic_ns()

    # --- frames

    def _read(self, node: Node, events: int) -> None:
        if self._holding and node.state is State.JOINED:
            self._hang_up(node)
            return
        if node.state is State.LEAVING and events & HANGUP:
            self._part(node)
            return
        try:
            records = node.receive()
        except BlockingIOError:
            return
        except OSError:
            self._part(node)
            return
        if not records and node.at_end:
            self._part(node)
            return
        routes, offer = self._routes, self._medium.offer
        try:
            for record in records:
                if node.state is State.JOINED:
                    key = record[wire.KEY_AT]
                    if key not in routes:
                        self._route(key)
                    offer(node, record)
                elif node.state is State.GREETING:
                    self._greet(node, record)
        except wire.WireError as error:
            self._expel(node, str(error))

    def _hang_up(self, node: Node) -> None:
        """A member ended while frames are held back: nothing can be read from it now, and nothing reaches it."""
        self._poller.unregister(node.fd)
        node.hung_up = True
        node.waiting = False
        node.out.clear()
        self._full.discard(node)

    def _route(self, key: bytes) -> tuple[Node, ...]:
        """The members that want frames with this key; WireError if there are no such frames."""
        identifier, extended = wire.check_frame(key)
        if len(self._routes) >= ROUTES:
            self._routes.clear()
        targets = tuple(node for node in self._members if node.wants(identifier, extended))
        self._routes[key] = targets
        return targets

    def _carry(self) -> None:
        """Bring the frames that the medium lets through to their receivers, as far as these can take them."""
        take, routes = self._medium.take, self._routes
        dirty: list[Node] = []
        while not self._full:
            now = time.monotonic_ns()
            taken = take(now)
            if taken is None:
                break
            sender, frame = taken
            key = frame[wire.KEY_AT]
            targets = routes.get(key)
            if targets is None:
                targets = self._route(key)
            stamped = wire.STAMP.pack(now + self._epoch) + frame[8:]
            for node in targets:
                if node is sender:
                    if not node.receive_own:
                        continue
                    node.out += stamped[:13] + bytes((stamped[13] | wire.OWN,)) + stamped[14:]
                else:
                    node.out += stamped
                if not node.dirty:
                    node.dirty = True
                    dirty.append(node)
        for node in dirty:
            node.dirty = False
            if node.state is State.JOINED and not node.waiting:
                self._flush(node)
            if len(node.out) >= self._queue and node.state is State.JOINED and not node.hung_up:
                self._full.add(node)
        if self._full:
            self._let_go_of_the_stalled(time.monotonic_ns())
        if bool(self._full) != self._holding:
            self._hold(bool(self._full))

    def _flush(self, node: Node) -> None:
        """Send what waits for `node`, as much as it takes."""
        try:
            node.send()
        except OSError:
            node.out.clear()  # it can receive no more; reading brings what it sent before, and then its end
            node.waiting = False
            if node.state is State.LEAVING:
                self._part(node)
                return
        if len(node.out) <= self._queue // 2:
            self._full.discard(node)
        if node.state is State.LEAVING and not node.out:
            self._part(node)
        elif bool(node.out) != node.waiting:
            node.waiting = bool(node.out)
            self._watch(node)

    def _hold(self, holding: bool) -> None:
        """Read from no member until those that lag have caught up; what they send waits in their sockets."""
        self._holding = holding
        for node in self._members:
            if node.hung_up and not holding:
                node.hung_up = False
                self._poller.register(node.fd, READ)
            elif not node.hung_up:
                self._watch(node)

    def _watch(self, node: Node) -> None:
        """Ask for the events that matter to `node` now."""
        if node.hung_up:
            return
        reading = node.state is State.GREETING or (node.state is State.JOINED and not self._holding)
        self._poller.modify(node.fd, (READ if reading else 0) | (WRITE if node.waiting else 0))

    # --- upkeep

    def _let_go_of_the_stalled(self, now: int) -> None:
        for node in list(self._full):
            if now - node.moved_at > self._stall:
                self._expel(node, f"it read nothing for {self._stall / SECOND:g} s while others waited")

    def _tidy(self, now: int) -> bool:
        """Let go of those that never say who they are; false when the hub itself shall end."""
        for node in list(self._nodes.values()):
            if node.state is State.GREETING and now - node.moved_at > GREETING * SECOND:
                self._expel(node, "no hello came")
        if not self._address.path.exists():
            log(f"{self._address.path} is gone: nobody new could come in, and a second hub might start")
            raise RuntimeError("the channel's address was removed")
        return bool(self._members) or now - self._left_at < self._linger


def log(text: str) -> None:
    """A line on stderr, which is the channel's log file when the hub runs in the background."""
    sys.stderr.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {text}\n")
    sys.stderr.flush()
