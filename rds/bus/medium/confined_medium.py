"""What becomes of a frame at its end: it reaches the others or is sent again, and the error counters follow.

Who went error passive or bus off is told, and let back. See confinement.py for the rules.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Generic, NamedTuple

from rds.bus.medium.bits import SECOND, SUSPEND
from rds.bus.medium.confinement import SEQUENCE, ErrorState
from rds.bus.medium.error_reports import DISTURBED, RESTARTED, report, state_report
from rds.bus.medium.fault_kinds import Fault
from rds.bus.medium.medium import Delivery, FaultRefused, Medium, Node
from rds.bus.medium.recovery import Recovery
from rds.bus.medium.station import Frame, Station


class Flight(NamedTuple, Generic[Node]):
    """What is on the wire."""

    senders: Sequence[Node]  # more than one where nodes send the very same frame, or collide
    frames: Sequence[Frame]  # theirs, in the same order
    bits: int  # with the interframe space
    end: int  # of the frame, or of its error frame
    free: int  # the next may start
    error: int = 0  # kind of error that broke it off; 0: none
    fault: Fault | None = None
    alone: bool = False  # nobody is there to acknowledge
    dropped: Sequence[Node] = ()  # passive nodes that lost a collision, and heard nothing of the frame


class ConfinedMedium(Medium[Node]):
    """Fault confinement of all stations. Instants and durations in ns."""

    def __init__(self, bitrate: int, changed: Callable[[Node, Station], None] | None = None):
        super().__init__(changed)
        self.bitrate = bitrate
        self._suspend = self.bit_time(SUSPEND)
        self._sequence = self.bit_time(SEQUENCE)
        self._recovery = Recovery(self._sequence)
        self._flight: Flight[Node] | None = None
        self._free = 0  # from when on a frame may start
        self._left: set[Node] = set()  # gone, with frames that still go over the bus
        self._ill = False  # some station may not hear
        self._counting = False  # some receive error counter is not 0

    def bit_time(self, bits: int) -> int:
        """The time of so many bits, rounded up."""
        return -(-bits * SECOND // self.bitrate)

    def _is_passive(self, node: Node) -> bool:
        return self.stations[node].counters.state is ErrorState.PASSIVE

    def _is_heard(self, senders: Collection[Node]) -> bool:
        """Whether anybody else is there to acknowledge."""
        return any(station.on_bus and node not in senders for node, station in self.stations.items())

    def _check_health(self) -> None:
        self._ill = not all(station.hears for station in self.stations.values())

    # --- the end of a flight

    def _land(self, time: int) -> None:
        """The frame or error frame in flight is over."""
        flight = self._flight
        assert flight is not None
        self._flight = None
        self._free = flight.free
        self._recovery.ended(flight.free)
        if not all(node in self.stations for node in flight.senders):
            self.errors += 1  # its sender has gone in the middle of it
            return
        both = (*flight.senders, *flight.dropped)
        if flight.error:
            self._land_broken(flight, both, time)
        else:
            self._land_whole(flight, both, time)
        for node in both:
            station = self.stations[node]
            if station.counters.state is ErrorState.PASSIVE:
                station.resume_at = flight.free + self._suspend
            if node in self._left and not (station.queue and station.on_bus):
                self._remove(node, time)

    def _land_whole(self, flight: Flight[Node], both: Sequence[Node], time: int) -> None:
        senders, fault = flight.senders, flight.fault
        self.frames += 1
        deaf = {*self._deaf(), *both[1:]} if self._ill or len(both) > 1 else set()
        if fault is not None and fault.kind == "lose":
            deaf |= {node for node, its in self.stations.items() if fault.receiver in (None, its.name)}
        for node in deaf:
            self.stations[node].lost += node not in both
        self._done.append(Delivery(senders[0], flight.frames[0].record, flight.end, deaf))
        if fault is not None and fault.kind == "duplicate":
            self.errors += 1
            self._again(senders[0], flight.frames[0])
            self._failed(senders[0], DISTURBED, time)
        else:
            for node, frame in zip(senders, flight.frames, strict=True):
                self._went_through(node, flight.bits, time)
                if frame.endless and self.stations[node].babbling:
                    self.stations[node].push(frame._replace(number=next(self._numbers)))
        for node in flight.dropped:
            self._failed(node, DISTURBED, time)
        self._count_received(True, both, time)

    def _land_broken(self, flight: Flight[Node], both: Sequence[Node], time: int) -> None:
        self.errors += 1
        for node, frame in zip(flight.senders, flight.frames, strict=True):
            self._again(node, frame)
        for node in both:
            if not self.stations[node].dead:
                self._failed(node, flight.error, time, flight.alone)
        self._count_received(False, both, time)

    def _again(self, node: Node, frame: Frame) -> None:
        """Let a frame that was not sent wait once more, unless its sender has stopped meanwhile."""
        station = self.stations[node]
        if not station.dead and (not frame.endless or station.babbling):
            station.push(frame)

    def _remove(self, node: Node, now: int) -> None:
        """The node is no more."""
        self._left.discard(node)
        self._recovery.forget([self.stations[node]])
        super().leave(node, now)
        self._check_health()

    # --- errors

    def _failed(self, node: Node, error: int, time: int, alone: bool = False) -> None:
        """A frame of `node` was broken off; `alone`: nobody but the sender saw it."""
        station = self.stations[node]
        station.errors += 1
        station.counters.failed_to_send(alone)
        if station.reports and not station.dead and not station.hung:
            self._done.append(Delivery(None, report(error, station.counters), time, (), node))
        self._tell(node, time)

    def _went_through(self, node: Node, bits: int, time: int) -> None:
        station = self.stations[node]
        station.sent += 1
        station.bits += bits
        if station.counters.tec:
            station.counters.sent()
            self._tell(node, time)

    def _count_received(self, whole: bool, besides: Collection[Node], time: int) -> None:
        """All on the bus but those `besides` have received a frame, or have seen it broken off."""
        if whole and not self._counting:
            return
        self._counting = False
        for node, station in self.stations.items():
            if station.on_bus and node not in besides:
                if whole:
                    station.counters.received()
                else:
                    station.counters.failed_to_receive()
                self._tell(node, time)
            self._counting = self._counting or station.counters.rec > 0

    def _tell(self, node: Node, time: int) -> None:
        """Say that a controller's error state has changed, if it has."""
        station = self.stations[node]
        state, warning = station.counters.state, station.counters.warning
        if station.told == (state, warning):
            return
        before, station.told = station.told[0], (state, warning)
        if station.reports and not station.dead and not station.hung:
            self._done.append(Delivery(None, state_report(station.counters), time, (), node))
        if state is before:
            return
        if state is ErrorState.OFF:
            self._ill = True
            station.drop_all()
            if station.restart_after is not None:
                self.at(time + station.restart_after, lambda at: self._ask_back(station, at))
        self._changed(node, station)

    def restart(self, node: Node, now: int) -> None:
        """Ask the node's controller to come back from bus off."""
        station = self.stations[node]
        if station.counters.state is not ErrorState.OFF:
            raise FaultRefused(f"{station.name} is {station.counters.state.words}, not bus off: nothing to restart")
        self._ask_back(station, now)

    def _ask_back(self, station: Station, now: int) -> None:
        if station.counters.state is ErrorState.OFF and station.plugged and not station.dead:
            self._recovery.ask(station, now)

    def _back(self, recovered: Iterable[Station], time: int) -> None:
        """These have seen 128 times eleven recessive bits."""
        back = {id(station) for station in recovered}
        for node, station in self.stations.items():
            if id(station) in back:
                station.counters.reset()
                station.told = (ErrorState.ACTIVE, False)
                if station.reports:
                    self._done.append(Delivery(None, report(RESTARTED, station.counters), time, (), node))
                self._changed(node, station)
        self._check_health()
