"""The hub's loop: every frame of every node to every other node. What it promises:

- one order: every node gets all frames in the same order, stamped by one clock that never steps;
- no loss: a frame that the hub has read reaches everybody. A node may lag by `QUEUE` bytes; then no further frame is
  carried until it has read, so senders wait;
- with bit timing, frames arrive when they would on a wire, as exactly as this process is on time; the stamps are
  exact in any case, and how late it was is in its statistics (hub_desk.py);
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
from rds.bus.board import SEATS, Board
from rds.bus.hub_desk import Desk
from rds.bus.hub_node import Node, State
from rds.bus.medium import Medium, UntimedMedium
from rds.bus.poller import HANGUP, READ, WRITE, make_poller
from rds.bus.station import Station

# 65,536 frames: 13 s of a control loop with five frames per millisecond, and 5 s with thirteen. So a monitor that
# stands still never holds up such a loop: it is let go in the moment in which its queue is full.
QUEUE = 65536 * wire.RECORD  # bytes
STALL = 5.0  # s
LINGER = 3.0  # s the hub stays without a node
GREETING = 5.0  # s for a connection to say who it is
# Sleeping wakes tens of µs late, so the hub spins before what is due on a bus with bit timing, and after the end of a
# frame, when answers to it are on their way.
SPIN = 100_000  # ns
ALERT = 100_000  # ns
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
        self._medium: Medium[Node] = UntimedMedium()
        self._desk = Desk(self._medium, self._note, time.monotonic_ns())
        self._board: Board | None = None
        self._paused: set[Node] = set()  # those whose controllers are full
        self._alert_until = 0
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
        poll = self._wait
        listening = self._listener.fileno()
        while True:
            for fd, events in poll():
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
        if self._board is not None:
            self._board.remove()
        self._listener.close()
        self._poller.close()

    def _wait(self) -> list[tuple[int, int]]:
        """The sockets that something has come from, when it has or when something is due."""
        due = None if self._full else self._medium.due()
        if due is None:
            return self._poller.poll(0.0 if time.monotonic_ns() < self._alert_until else self._patience())
        left = due - time.monotonic_ns()
        if left > SPIN and due > self._alert_until:
            # epoll's own time-outs are whole ms
            self._poller.sleep(min((left - SPIN) / SECOND, self._patience()))
        return self._poller.poll(0.0)

    def _patience(self) -> float:
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
        if hello.purpose == wire.ASK:
            node.state = State.ASKING
        else:
            self._join(node, node.settings or wire.Settings())
        node.out += wire.encode_welcome(self._welcome(node.number))
        self._flush(node)

    def _join(self, node: Node, settings: wire.Settings) -> None:
        """Make it a node of the bus; the first one decides what bus it is. WireError if it expects another."""
        medium = self._medium
        if not self._members:
            medium = self._choose_medium(settings)
        elif settings.bitrate not in (0, medium.bitrate):
            raise wire.WireError(
                f"the bus runs at {medium.bitrate} bit/s, not {settings.bitrate}"
                if medium.bitrate
                else "the bus is untimed; open it without a bitrate"
            )
        elif settings.data_bitrate not in (0, medium.data_bitrate):
            raise wire.WireError(
                f"the data rate is {medium.data_bitrate or medium.bitrate}, not {settings.data_bitrate}"
            )
        now = time.monotonic_ns()
        seats = {member.number % SEATS for member in self._members}
        self._last_number += 1
        while self._last_number % SEATS in seats:
            self._last_number += 1
        node.number = self._last_number
        node.state = State.JOINED
        restart = None if settings.restart_ms < 0 else settings.restart_ms * 1_000_000
        medium.join(node, Station(node.number, settings.name, settings.error_frames, restart), now)
        if self._board is not None:
            self._board.show(node.number, 0)
        self._members.append(node)
        self._routes.clear()

    def _choose_medium(self, settings: wire.Settings) -> Medium[Node]:
        """What the first node asks for."""
        if self._board is not None:
            self._board.remove()
            self._board = None
        if settings.bitrate:
            from rds.bus.timed_medium import TimedMedium  # the untimed bus starts without its tables

            self._board = Board(self._address.board_path)
            self._medium = TimedMedium(settings.bitrate, settings.data_bitrate or None, self._show)
        else:
            self._medium = UntimedMedium()
        self._desk = Desk(self._medium, self._note, time.monotonic_ns())
        return self._medium

    def _show(self, node: Node, station: Station) -> None:
        """A controller's error state has changed."""
        if self._board is not None:
            self._board.show(node.number, station.counters.state)

    def _welcome(self, number: int) -> wire.Welcome:
        return wire.Welcome(number, os.getpid(), self._medium.bitrate, self._medium.data_bitrate or 0)

    def _note(self, text: str) -> None:
        self.noted = True
        log(text)

    def _retune(self, visitor: Node, number: int) -> None:
        """Give the filters that `visitor` has brought to the member with this number."""
        for member in self._members:
            if member.number == number:
                member.filters = visitor.filters
                self._routes.clear()
                visitor.out += wire.encode_welcome(self._welcome(number))
                visitor.state = State.LEAVING
                self._flush(visitor)
                return
        self._expel(visitor, f"there is no node {number} on this bus")

    def _expel(self, node: Node, reason: str) -> None:
        """End a connection; the node reads what is on its way to it and then the reason."""
        self._note(f"node {node.number} was let go: {reason}")
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
                self._note(f"node {node.number} ended in the middle of a frame")
            self._forget_member(node)
        elif node.state is State.ASKING:
            self._desk.forget(node, time.monotonic_ns())
        node.state = State.GONE
        del self._nodes[node.fd]
        if not node.hung_up:
            self._poller.unregister(node.fd)
        node.sock.close()

    def _forget_member(self, node: Node) -> None:
        self._members.remove(node)
        self._full.discard(node)
        self._paused.discard(node)
        self._routes.clear()
        self._left_at = time.monotonic_ns()
        self._medium.leave(node, self._left_at)

    # --- frames

    def _read(self, node: Node, events: int) -> None:
        if (self._holding or node.paused) and node.state is State.JOINED:
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
        routes, medium, now = self._routes, self._medium, time.monotonic_ns()
        try:
            for record in records:
                if node.state is State.JOINED:
                    key = record[wire.KEY_AT]
                    if key not in routes:
                        self._route(key)
                    if medium.bitrate:
                        self._desk.pickup.add(now - wire.STAMP.unpack_from(record)[0])
                    medium.offer(node, record, now)
                elif node.state is State.GREETING:
                    self._greet(node, record)
                    medium = self._medium
                elif node.state is State.ASKING:
                    self._answer(node, record, now)
        except wire.WireError as error:
            self._expel(node, str(error))
            return
        if medium.is_full(node) and node.state is State.JOINED:
            node.paused = True
            self._paused.add(node)
            self._watch(node)

    def _answer(self, node: Node, record: bytes, now: int) -> None:
        question = self._desk.take_part(node, *wire.decode_part(record))
        if question is not None:
            node.out += wire.encode_text(self._desk.answer(question, node, now))
            self._flush(node)

    def _hang_up(self, node: Node) -> None:
        """A member ended while it has to wait: nothing can be read from it now, and nothing reaches it."""
        station = self._medium.stations.get(node)
        if station is not None and not station.plugged:  # what it sent will never go
            self._part(node)
            return
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
            delivery = take(now)
            if delivery is None:
                break
            sender, frame, at, deaf, only = delivery
            if at:
                self._desk.delivery.add(now - at)
                self._alert_until = at + ALERT
            stamped = wire.STAMP.pack((at or now) + self._epoch) + frame[8:]
            if only is not None:
                targets: tuple[Node, ...] = (only,) if only.state is State.JOINED else ()
            else:
                key = frame[wire.KEY_AT]
                known = routes.get(key)
                targets = self._route(key) if known is None else known
            for node in targets:
                if node is sender:
                    if not node.receive_own:
                        continue
                    node.out += stamped[:13] + bytes((stamped[13] | wire.OWN,)) + stamped[14:]
                elif deaf and node in deaf:
                    continue
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
        if self._paused:
            self._go_on()
        if self._full:
            self._let_go_of_the_stalled(time.monotonic_ns())
        if bool(self._full) != self._holding:
            self._hold(bool(self._full))

    def _go_on(self) -> None:
        """Read again from those whose controllers have room."""
        for node in list(self._paused):
            if not self._medium.is_full(node):
                self._paused.discard(node)
                node.paused = False
                if node.hung_up and not self._holding:
                    node.hung_up = False
                    self._poller.register(node.fd, READ)
                else:
                    self._watch(node)

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
            if node.hung_up and not holding and not node.paused:
                node.hung_up = False
                self._poller.register(node.fd, READ)
            elif not node.hung_up:
                self._watch(node)

    def _watch(self, node: Node) -> None:
        """Ask for the events that matter to `node` now."""
        if node.hung_up:
            return
        member = node.state is State.JOINED and not self._holding and not node.paused
        reading = member or node.state in (State.GREETING, State.ASKING)
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
