"""The hub's loop: every frame of every node to every other node. What it promises:

- one order: every node gets all frames in the same order, stamped by one clock that never steps;
- no loss: a frame that the hub has read reaches everybody. A node may lag by `QUEUE` bytes; then no further frame is
  carried until it has read, so senders wait;
- with bit timing, frames arrive when they would on a wire, as exactly as this process is on time; the stamps are
  exact in any case, and how late it was is in its statistics (hub_requests.py);
- nobody waits for ever: a node that reads nothing for `stall` seconds while the others wait is let go and told so;
- garbage from one node ends that node's connection and nobody else's.
"""

from __future__ import annotations

import os
import time

from rds.bus.hub import wire
from rds.bus.hub.address import Address
from rds.bus.hub.hub_node import Node, State
from rds.bus.hub.hub_nodes import HubNodes, log
from rds.bus.hub.poller import HANGUP, WRITE
from rds.bus.medium.bits import SECOND

# 65,536 frames: 13 s of a control loop with five frames per millisecond, and 5 s with thirteen. So a monitor that
# stands still never holds up such a loop: it is let go in the moment in which its queue is full.
QUEUE = 65536 * wire.RECORD  # bytes
STALL = 5.0  # s
LINGER = 3.0  # s the hub stays without a node
GREETING = 5.0  # s for a connection to say who it is
# Sleeping wakes some µs late (tens without real-time priority), so the hub spins before what is due on a bus with bit
# timing. On a single processor that would only keep the others from running; and more of it, a quarter of a frame at
# 1 Mbit/s, gains nothing and takes a processor from those that answer.
SPIN = 30_000  # ns
MOST_UNREAD = 1 << 20  # bytes of answers to one that asks
ROUTES = 8192  # kinds of frame whose receivers are remembered


class Hub(HubNodes):
    """Sockets in, sockets out; `medium` decides what goes when."""

    def __init__(self, address: Address, stall: float = STALL, linger: float = LINGER, queue: int = QUEUE):
        super().__init__(address, stall, queue)
        self._linger = int(linger * SECOND)
        alone = (os.cpu_count() or 1) == 1
        self._spin = 0 if alone else SPIN
        now = time.monotonic_ns()
        self._epoch = time.time_ns() - now
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
        if self._error_states is not None:
            self._error_states.remove()
        self._listener.close()
        self._poller.close()

    def _wait(self) -> list[tuple[int, int]]:
        """The sockets that something has come from, when it has or when something is due."""
        due = None if self._full else self._medium.due()
        if due is None:
            return self._poller.poll(self._patience())
        left = due - time.monotonic_ns()
        if left > self._spin:
            # epoll's own time-outs are whole ms
            self._poller.sleep(min((left - self._spin) / SECOND, self._patience()))
        return self._poller.poll(0.0)

    def _patience(self) -> float:
        """How long to sleep if nothing happens, s."""
        if self._full or len(self._members) != len(self._nodes) or not self._members:
            return 0.1
        return 1.0

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
                        self._requests.pickup.add(now - wire.STAMP.unpack_from(record)[0])
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
        question = self._requests.take_part(node, *wire.decode_part(record))
        if question is not None:
            node.out += wire.encode_text(self._requests.answer(question, node, now))
            self._flush(node)
            if len(node.out) > MOST_UNREAD:
                raise wire.WireError("it asks and does not read the answers")

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
                self._requests.delivery.add(now - at)
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

    # --- upkeep

    def _tidy(self, now: int) -> bool:
        """Let go of those that never say who they are; false when the hub itself shall end."""
        for node in list(self._nodes.values()):
            if node.state is State.GREETING and now - node.moved_at > GREETING * SECOND:
                self._expel(node, "no hello came")
        if self._members and all(member.hung_up for member in self._members):
            for member in list(self._members):  # nobody is left to take what these had still to send
                self._part(member)
        if not self._address.path.exists():
            log(f"{self._address.path} is gone: nobody new could come in, and a second hub might start")
            raise RuntimeError("the channel's address was removed")
        return bool(self._members) or now - self._left_at < self._linger
