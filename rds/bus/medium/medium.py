"""The medium: which of the waiting frames goes over the bus next, and when.

The hub owns sockets and knows nothing of this; a medium knows nothing of sockets, and of time only what it is told:
so it can be tried out in virtual time. This file holds what all media share, and the untimed one. Times are in ns on
the monotonic clock.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Collection, Hashable
from heapq import heappop, heappush
from itertools import count
from typing import Generic, NamedTuple, TypeVar

from rds.bus.medium.frame_faults import FrameFaults
from rds.bus.medium.station import Frame, Station

Node = TypeVar("Node", bound=Hashable)

QUEUE = 32  # frames that a controller holds; then its node has to wait


class FaultRefused(Exception):
    """A fault that can't be on this bus, or not now; the text says why."""


class Delivery(NamedTuple, Generic[Node]):
    """A frame that is complete."""

    sender: Node | None
    frame: bytes
    at: int  # end of its end-of-frame field; 0: now
    deaf: Collection[Node] = ()  # nodes that do not get it
    only: Node | None = None  # the one node that gets it: an error frame is its own controller's


class Medium(ABC, Generic[Node]):
    """What all media have: stations, an agenda of what is to happen when, and faults."""

    bitrate = 0  # bit/s; 0: no bits
    data_bitrate: int | None = None

    def __init__(self, changed: Callable[[Node, Station], None] | None = None):
        self.stations: dict[Node, Station] = {}
        self.frame_faults = FrameFaults()
        self.frames = 0  # that went through
        self.errors = 0  # error frames
        self.busy = 0  # ns in which the bus was not free
        self._changed = changed or (lambda node, station: None)
        self._agenda: list[tuple[int, int, Callable[[int], None]]] = []
        self._numbers = count()
        self._done: deque[Delivery[Node]] = deque()

    # --- the hub's side

    def join(self, node: Node, station: Station, now: int) -> None:
        """`node` is on the bus from now on."""
        self.stations[node] = station

    def leave(self, node: Node, now: int) -> None:
        """`node` has gone. What it sent before still goes over the bus, where it can."""
        self.stations.pop(node, None)

    @abstractmethod
    def offer(self, node: Node, frame: bytes, now: int) -> None:
        """`node` wants to send `frame` (a wire record)."""

    @abstractmethod
    def take(self, now: int) -> Delivery[Node] | None:
        """The next frame whose transmission is complete at `now`, in the bus's one order; None if there is none."""

    @abstractmethod
    def due(self) -> int | None:
        """When something is to be done next; None if nothing is."""

    def is_full(self, node: Node) -> bool:
        """Whether the node has to wait before it offers more."""
        station = self.stations.get(node)
        return station is not None and len(station.queue) >= QUEUE

    # --- what is to happen

    def at(self, time: int, action: Callable[[int], None]) -> None:
        """Call `action(time)` when the bus's time line comes to `time`."""
        heappush(self._agenda, (time, next(self._numbers), action))

    def _happen(self, now: int) -> None:
        while self._agenda and self._agenda[0][0] <= now:
            time, _, action = heappop(self._agenda)
            action(time)

    # --- faults

    def unplug(self, node: Node, now: int) -> None:
        """Pull the node's plug. What it sends waits in its controller."""
        self.stations[node].plugged = False

    def plug(self, node: Node, now: int) -> None:
        """Plug it in again."""
        self.stations[node].plugged = True

    def die(self, node: Node, now: int) -> None:
        """The node stops for ever, in the middle of whatever it does."""
        station = self.stations[node]
        station.dead = True
        station.drop_all()

    def hang(self, node: Node, now: int) -> None:
        """The node's software stops: frames are acknowledged by its controller and lost, and it sends none."""
        self.stations[node].hung = True

    def wake(self, node: Node, now: int) -> None:
        """It goes on."""
        self.stations[node].hung = False

    def babble(self, node: Node, identifier: int, now: int) -> None:
        """The node sends frames with this identifier without a pause."""
        raise FaultRefused("babble needs a bus with bit timing: without it, a flood has no rate; give a bitrate")

    def silence(self, node: Node, now: int) -> None:
        """It stops."""
        self.stations[node].silence()

    def restart(self, node: Node, now: int) -> None:
        """Ask the node's controller to come back from bus off."""
        raise FaultRefused("restart needs a bus with bit timing: without it, nobody goes bus off")

    def _accepts(self, station: Station) -> bool:
        """Whether a station's software and controller still take frames to send; what they don't is counted."""
        if station.dead or station.hung:
            station.lost += 1
            return False
        return True

    def _deaf(self) -> tuple[Node, ...]:
        return tuple(node for node, station in self.stations.items() if not station.hears)


class UntimedMedium(Medium[Node]):
    """First come, first served, at once."""

    def __init__(self, changed: Callable[[Node, Station], None] | None = None) -> None:
        super().__init__(changed)
        self._waiting: deque[Delivery[Node]] = deque()
        self._ill: set[Node] = set()  # nodes with a fault

    def offer(self, node: Node, frame: bytes, now: int) -> None:
        """Takes the frame at once, unless a fault has something against it."""
        if self._agenda:
            self._happen(now)
        if self._ill or self.frame_faults:
            self._offer_with_faults(node, frame, now)
        else:
            self._waiting.append(Delivery(node, frame, 0))

    def _offer_with_faults(self, node: Node, frame: bytes, now: int) -> None:
        station = self.stations.get(node)
        if station is not None and not self._accepts(station):
            return
        if station is not None:
            delay = self.frame_faults.delay(station.name, frame, now)
            if delay:
                self.at(now + delay, lambda time: self._send_late(node, frame, time))
                return
        self._send(node, station, frame, now)

    def _send_late(self, node: Node, frame: bytes, now: int) -> None:
        """A frame that has waited in its sender, unless that has died or gone meanwhile."""
        station = self.stations.get(node)
        if station is not None and not station.dead:
            self._send(node, station, frame, now)

    def _send(self, node: Node, station: Station | None, frame: bytes, now: int) -> None:
        if station is None:
            self._waiting.append(Delivery(node, frame, 0, self._deaf()))
            return
        if not station.plugged:
            station.push(Frame(0, next(self._numbers), frame))
            return
        strike = self.frame_faults.strike(station.name, frame, now)
        deaf = self._deaf()
        if strike is not None and strike.kind == "lose":
            missed = [other for other, its in self.stations.items() if strike.receiver in (None, its.name)]
            deaf = tuple({*deaf, *missed})
        for other in deaf:
            self.stations[other].lost += other is not node
        self._waiting.append(Delivery(node, frame, 0, deaf))
        if strike is not None and strike.kind == "duplicate":
            self._waiting.append(Delivery(node, frame, 0, deaf))

    def take(self, now: int) -> Delivery[Node] | None:
        """The hub stamps each frame when it takes it."""
        if self._agenda:
            self._happen(now)
        if not self._waiting:
            return None
        self.frames += 1
        return self._waiting.popleft()

    def due(self) -> int | None:
        """At once if a frame waits."""
        if self._waiting:
            return 0
        return self._agenda[0][0] if self._agenda else None

    def unplug(self, node: Node, now: int) -> None:
        super().unplug(node, now)
        self._ill.add(node)

    def plug(self, node: Node, now: int) -> None:
        super().plug(node, now)
        station = self.stations[node]
        waiting, station.queue = sorted(station.queue), []
        for frame in waiting:
            self._send(node, station, frame.record, now)
        self._mend(node)

    def die(self, node: Node, now: int) -> None:
        super().die(node, now)
        self._ill.add(node)

    def hang(self, node: Node, now: int) -> None:
        super().hang(node, now)
        self._ill.add(node)

    def wake(self, node: Node, now: int) -> None:
        super().wake(node, now)
        self._mend(node)

    def leave(self, node: Node, now: int) -> None:
        super().leave(node, now)
        self._ill.discard(node)

    def _mend(self, node: Node) -> None:
        if self.stations[node].hears:
            self._ill.discard(node)
