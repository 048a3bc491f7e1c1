"""The medium with bit timing: arbitration and exact frame times, also of frames that an error breaks off.

Each frame takes its exact bits (bits.py) and is delivered at the end of its end-of-frame field. The next one starts
after the 3-bit interframe space, or as soon as one is offered; of those that wait then the lowest in arbitration
goes, and nothing interrupts it. All this happens on the bus's own time line, in whole ns, which is computed up to the
instant that the caller says it is now and never beyond it: a frame's start, end and stamp do not depend on when
anybody looked. What does depend on it is when an offered frame counts as offered: at the instant given to offer().

Sources: ISO 11898-1:2015, 10.4 (interframe space, suspend transmission) and 10.6 to 10.9 (arbitration); for errors
see confinement.py, error_flags.py, collision.py and recovery.py.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum, auto
from typing import Any

from rds.bus.hub import wire
from rds.bus.medium.bit_string import bit_string
from rds.bus.medium.bits import ERROR_DELIMITER, ERROR_FLAG, INTERFRAME, Bits
from rds.bus.medium.collision import collide
from rds.bus.medium.confined_medium import ConfinedMedium, Flight
from rds.bus.medium.confinement import PASSIVE, ErrorState
from rds.bus.medium.error_flags import broken_frame, faulty_bit, flipped
from rds.bus.medium.error_reports import ACKNOWLEDGEMENT, DISTURBED
from rds.bus.medium.fault_kinds import ENDLESS, Fault
from rds.bus.medium.medium import Delivery, Node
from rds.bus.medium.station import Frame, Station, flags_of, record_bits, record_priority
from rds.core.errors import InputError

BITRATE = 1_000_000  # bit/s
_ERROR_FRAME = ERROR_FLAG + ERROR_DELIMITER  # bits
_BEHIND_ACK = 8  # bits of a frame behind its ACK slot: delimiter and end of frame
_CUT_OFF = ERROR_FLAG + _ERROR_FRAME  # bits from where a sender falls silent to the end of the others' error frame


class _Step(Enum):
    """What can happen next on the time line."""

    AGENDA = auto()
    LAND = auto()
    START = auto()
    RECOVER = auto()
    NOTHING = auto()


class TimedMedium(ConfinedMedium[Node]):
    """A bus at `bitrate` bit/s; the data of CAN FD frames with bit-rate switch at `data_bitrate` (None: the same).

    `changed(node, station)` is called when a station's error state changes.
    """

    def __init__(
        self,
        bitrate: int = BITRATE,
        data_bitrate: int | None = None,
        changed: Callable[[Node, Station], None] | None = None,
    ):
        super().__init__(bitrate, changed)
        self.data_bitrate = data_bitrate

    # --- the hub's side

    def join(self, node: Node, station: Station, now: int) -> None:
        """`node` is on the bus from now on."""
        self._advance(now, False)
        super().join(node, station, now)

    def leave(self, node: Node, now: int) -> None:
        """`node` has gone. What it sent before still goes over the bus, if somebody else is there."""
        self._advance(now, False)
        station = self.stations[node]
        station.silence()
        others = any(its.on_bus for other, its in self.stations.items() if other != node and other not in self._left)
        if others and station.on_bus and (station.queue or self._is_sending(node)):
            self._left.add(node)
            return
        self._cut_off(node, now)
        self._remove(node, now)

    def offer(self, node: Node, frame: bytes, now: int) -> None:
        """`node` wants to send `frame` from `now` on. WireError for an error frame."""
        if frame[13] & wire.ERROR:
            raise wire.WireError("error frames can't be sent on a bus with bit timing")
        self._advance(now, False)
        station = self.stations[node]
        if not self._accepts(station):
            return
        if self.frame_faults and (delay := self.frame_faults.delay(station.name, frame, now)):
            self.at(now + delay, lambda time: self._push(node, frame, time))
        else:
            self._push(node, frame, now)

    def take(self, now: int) -> Delivery[Node] | None:
        """The next frame (or a controller's error report) that was complete by `now`; None if there is none."""
        if not self._done:
            self._advance(now, True)
        return self._done.popleft() if self._done else None

    def due(self) -> int | None:
        """The end of the frame in flight, or when the next one may start, or when something else happens."""
        if self._done:
            return self._done[0].at
        time, step = self._next()
        if step is _Step.NOTHING:
            return None
        flight = self._flight
        if step is _Step.LAND and flight is not None and flight.alone:
            sender = flight.senders[0]
            if sender in self.stations and self._is_passive(sender):  # it may have gone in the middle of its frame
                return self._agenda[0][0] if self._agenda else None  # nothing changes until somebody joins
        return time

    # --- the time line

    def _next(self) -> tuple[int, _Step]:
        flight = self._flight
        if flight is not None:
            time, step = flight.end, _Step.LAND
        else:
            time, step = self._start_time(), _Step.START
            if self._recovery and (recovered := self._recovery.time()) <= time:
                time, step = recovered, _Step.RECOVER
        if self._agenda and self._agenda[0][0] <= time:
            return self._agenda[0][0], _Step.AGENDA
        return (time, step) if time < ENDLESS else (ENDLESS, _Step.NOTHING)

    def _advance(self, now: int, starting: bool) -> None:
        """Let everything happen up to `now`; a frame that starts just then only if `starting`.

        Without that, frames that are offered at the same instant meet in one arbitration.
        """
        while True:
            time, step = self._next()
            if time > now or (time == now and step is _Step.START and not starting):
                return
            if step is _Step.LAND:
                self._land(time)
            elif step is _Step.START:
                self._start(time, now)
            elif step is _Step.AGENDA:
                self._happen(time)
            else:
                self._back(self._recovery.reached(time), time)

    def _start_time(self) -> int:
        """When the next frame starts if nobody offers one before."""
        earliest = ENDLESS
        for station in self.stations.values():
            if station.queue and station.resume_at < earliest and station.on_bus:
                earliest = station.resume_at
        return max(self._free, earliest)

    def _start(self, time: int, now: int) -> None:
        """Arbitration at `time`; nobody offers anything until `now`."""
        if self._recovery:
            self._back(self._recovery.started(time), time)
        best, senders = ENDLESS, []
        for node, station in self.stations.items():
            if station.queue and station.resume_at <= time and station.on_bus:
                its = station.queue[0].priority
                if its < best:
                    best, senders = its, [node]
                elif its == best:
                    senders.append(node)
        if len(senders) > 1:
            self._collide(senders, time)
            return
        node = senders[0]
        station = self.stations[node]
        frames = (station.pop(),)
        record = frames[0].record
        if not self._is_heard(senders):
            self._fly_alone(node, frames, time, now)
            return
        fault = self.frame_faults.strike(station.name, record, time) if self.frame_faults else None
        broken = self._corrupted(node, record, fault.bit) if fault is not None and fault.kind == "corrupt" else None
        if broken is not None:
            self._fly(senders, frames, broken, time, error=DISTURBED)
        else:
            self._fly(senders, frames, record_bits(record), time, fault=fault)

    def _fly(self, senders: Sequence[Node], frames: Sequence[Frame], bits: Bits, time: int, **how: Any) -> None:
        end = time + bits.time(self.bitrate, self.data_bitrate)
        fault: Fault | None = how.get("fault")
        if fault is not None and fault.kind == "duplicate":
            # the sender sees an error in the frame's very last bit, when all others have taken it already
            bits = bits._replace(nominal=bits.nominal + _ERROR_FRAME)
        free = time + bits.time(self.bitrate, self.data_bitrate, interframe=True)
        self._flight = Flight(senders, frames, bits.total + INTERFRAME, end, free, **how)
        self.busy += free - time

    def _fly_alone(self, node: Node, frames: Sequence[Frame], time: int, now: int) -> None:
        """Nobody acknowledges: the sender's error flag begins behind the ACK slot, again and again."""
        bits = _unacknowledged(frames[0])
        if self._is_passive(node):  # nothing changes any more
            attempt = bits.time(self.bitrate, self.data_bitrate, interframe=True) + self._suspend
            until = min(now, self._agenda[0][0]) if self._agenda else now
            failed = max(0, (until - time) // attempt)
            self.stations[node].errors += failed
            self.errors += failed
            time += failed * attempt
        self._fly((node,), frames, bits, time, error=ACKNOWLEDGEMENT, alone=True)

    def _corrupted(self, node: Node, record: bytes, bit: int | None) -> Bits | None:
        """The bits on the wire if a bit is disturbed; None if this frame has no such bit."""
        flags = flags_of(record)
        string = bit_string(**flags)
        try:
            bit = faulty_bit(string, flags["extended"], bit)
        except InputError:
            return None
        answered = any(
            station.on_bus and station.counters.state is ErrorState.ACTIVE
            for other, station in self.stations.items()
            if other != node
        )
        return broken_frame(string, flipped(string, bit), self._is_passive(node), answered)

    def _collide(self, nodes: Sequence[Node], time: int) -> None:
        frames = {node: self.stations[node].pop() for node in nodes}
        strings = {node: bit_string(**flags_of(frame.record)) for node, frame in frames.items()}
        senders, dropped, bits = collide(strings, {node: not self._is_passive(node) for node in nodes})
        for node in dropped:
            self.stations[node].push(frames[node])
        how: dict[str, Any] = {"dropped": dropped}
        if bits is not None:
            how["error"] = DISTURBED
        elif self._is_heard(nodes):
            bits = strings[senders[0]].measure()
        else:
            bits = _unacknowledged(frames[senders[0]])
            how["error"] = ACKNOWLEDGEMENT
        self._fly(senders, [frames[node] for node in senders], bits, time, **how)

    # --- nodes that come, go and fail

    def _push(self, node: Node, record: bytes, now: int, endless: bool = False) -> None:
        """A frame waits from `now` on."""
        station = self.stations.get(node)
        if station is None:
            return  # delayed, and its sender has gone
        if station.counters.state is ErrorState.OFF:
            station.lost += 1
            return
        if self._flight is None:
            self._free = max(self._free, now)
        station.push(Frame(record_priority(record), next(self._numbers), record, endless))
        self._try_alone(node, now)

    def unplug(self, node: Node, now: int) -> None:
        """Pull the node's plug. It sends without an acknowledgement, again and again, the first in arbitration."""
        self._advance(now, False)
        super().unplug(node, now)
        self._cut_off(node, now)
        self._check_health()
        self._try_alone(node, now)

    def plug(self, node: Node, now: int) -> None:
        """Plug it in again: it listens for eleven bits, and then sends what still waits."""
        self._advance(now, False)
        super().plug(node, now)
        station = self.stations[node]
        station.resume_at = max(station.resume_at, now + self._sequence)
        self._check_health()

    def die(self, node: Node, now: int) -> None:
        """The node stops for ever, in the middle of whatever it does."""
        self._advance(now, False)
        super().die(node, now)
        self._cut_off(node, now)
        self._check_health()

    def hang(self, node: Node, now: int) -> None:
        """The node's software stops; what its controller holds is still sent."""
        self._advance(now, False)
        super().hang(node, now)
        self._check_health()

    def wake(self, node: Node, now: int) -> None:
        """It goes on."""
        self._advance(now, False)
        super().wake(node, now)
        self._check_health()

    def babble(self, node: Node, identifier: int, now: int) -> None:
        """The node sends frames with this identifier and eight bytes of zeros without a pause."""
        self._advance(now, False)
        station = self.stations[node]
        if station.dead or station.counters.state is ErrorState.OFF:
            return
        station.silence()
        station.babbling = True
        flags = wire.EXTENDED if identifier > 0x7FF else 0
        record = wire.HEADER.pack(0, identifier, wire.FRAME, flags, 8, 8) + bytes(wire.DATA)
        self._push(node, record, now, endless=True)

    def _is_sending(self, node: Node) -> bool:
        return self._flight is not None and node in self._flight.senders

    def _cut_off(self, node: Node, now: int) -> None:
        """The node falls silent. If it was sending, the others soon miss a stuff bit and send error flags."""
        flight = self._flight
        if flight is None or not self._is_sending(node) or flight.error or len(flight.senders) > 1:
            return
        end = min(flight.end, now + self.bit_time(_CUT_OFF))
        free = end + self.bit_time(INTERFRAME)
        self.busy += free - flight.free
        self._flight = flight._replace(end=end, free=free, error=DISTURBED)

    def _try_alone(self, node: Node, now: int) -> None:
        """An unplugged node's attempts, whose errors count until it is error passive."""
        station = self.stations.get(node)
        if station is None or station.plugged or station.trying or not station.queue:
            return
        if station.dead or station.counters.tec >= PASSIVE:
            return
        station.trying = True
        bits = _unacknowledged(station.queue[0])

        def failed(time: int) -> None:
            station.trying = False
            if node in self.stations and not station.plugged and not station.dead:
                self._failed(node, ACKNOWLEDGEMENT, time, alone=True)
                self._try_alone(node, time)

        self.at(now + bits.time(self.bitrate, self.data_bitrate, interframe=True), failed)


def _unacknowledged(frame: Frame) -> Bits:
    """Up to the ACK slot, and an error frame."""
    bits = record_bits(frame.record)
    return bits._replace(nominal=bits.nominal - _BEHIND_ACK + _ERROR_FRAME)
