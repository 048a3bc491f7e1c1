"""The hub's nodes: who comes, what bus the first one chooses, who has to wait, who is let go."""

from __future__ import annotations

import os
import socket
import sys
import time

from rds.bus.hub import wire
from rds.bus.hub.address import Address, foreign_user
from rds.bus.hub.error_states import SEATS, ErrorStateFile
from rds.bus.hub.hub_node import Node, State
from rds.bus.hub.hub_requests import Requests
from rds.bus.hub.poller import READ, WRITE, make_poller
from rds.bus.medium.bits import SECOND
from rds.bus.medium.medium import Medium, UntimedMedium
from rds.bus.medium.station import Station

STRANGERS = 64  # connections that have not said who they are, where anybody may connect


class HubNodes:
    """Connections and their states; what they send is the loop's business (hub_loop.py)."""

    def __init__(self, address: Address, stall: float, queue: int):
        self._address = address
        self._stall = int(stall * SECOND)
        self._queue = queue
        self._listener = address.listen()
        self._listener.setblocking(False)
        self._poller = make_poller()
        self._poller.register(self._listener.fileno(), READ)
        self._medium: Medium[Node] = UntimedMedium()
        self._requests = Requests(self._medium, self._note, time.monotonic_ns())
        self._error_states: ErrorStateFile | None = None
        self._paused: set[Node] = set()  # those whose controllers are full
        self._nodes: dict[int, Node] = {}  # by file descriptor
        self._members: list[Node] = []  # those on the bus
        self._full: set[Node] = set()  # those for which the others wait
        self._holding = False
        self._routes: dict[bytes, tuple[Node, ...]] = {}  # by a frame's key
        self._last_number = 0
        self._left_at = time.monotonic_ns()  # by the last one
        self.noted = False  # something stands in the log that is worth keeping

    # --- connections

    def _accept(self) -> None:
        try:
            sock, _ = self._listener.accept()
        except OSError as error:  # it hung up again, or there are no descriptors left
            log(f"could not accept a connection: {error}")
            return
        if self._address.unix and (other := foreign_user(sock)) is not None:
            self._note(f"a process of another user ({other}) was turned away; look who may enter {self._address.path}")
            sock.close()
            return
        sock.setblocking(False)
        if not self._address.unix:
            strangers = [node for node in self._nodes.values() if node.state is State.GREETING]
            if len(strangers) >= STRANGERS:
                self._expel(strangers[0], f"no hello came, and {STRANGERS} others wait")
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
        if self._error_states is not None:
            self._error_states.show(node.number, 0)
        self._members.append(node)
        self._routes.clear()

    def _choose_medium(self, settings: wire.Settings) -> Medium[Node]:
        """What the first node asks for."""
        if self._error_states is not None:
            self._error_states.remove()
            self._error_states = None
        if settings.bitrate:
            from rds.bus.medium.timed_medium import TimedMedium  # the untimed bus starts without its tables

            try:
                self._error_states = ErrorStateFile(self._address.error_states_path)
            except OSError as error:
                raise wire.WireError(f"the file of its error states cannot be made: {error.strerror}") from error
            self._medium = TimedMedium(settings.bitrate, settings.data_bitrate or None, self._show)
        else:
            self._medium = UntimedMedium()
        self._requests = Requests(self._medium, self._note, time.monotonic_ns())
        return self._medium

    def _show(self, node: Node, station: Station) -> None:
        """A controller's error state has changed."""
        if self._error_states is not None:
            self._error_states.show(node.number, station.counters.state)

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
            self._requests.forget(node, time.monotonic_ns())
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

    # --- those that have to wait

    def _hang_up(self, node: Node) -> None:
        """A member ended while it has to wait: nothing can be read from it now, and nothing reaches it."""
        station = self._medium.stations.get(node)
        # what nobody can take will never go
        if station is not None and (not station.on_bus or len(self._members) == 1):
            self._part(node)
            return
        self._poller.unregister(node.fd)
        node.hung_up = True
        node.waiting = False
        node.out.clear()
        self._full.discard(node)

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

    def _let_go_of_the_stalled(self, now: int) -> None:
        for node in list(self._full):
            if now - node.moved_at > self._stall:
                self._expel(node, f"it read nothing for {self._stall / SECOND:g} s while others waited")


def log(text: str) -> None:
    """A line on stderr, which is the channel's log file when the hub runs in the background."""
    sys.stderr.write(f"{time.strftime('%Y-%m-%d %H:%M:%S')} {text}\n")
    sys.stderr.flush()
