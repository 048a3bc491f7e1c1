"""A node as the bus sees it: its CAN controller with what waits to be sent, its error counters and its plug."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Any, NamedTuple

from rds.bus.hub import wire
from rds.bus.medium.bits import Bits, frame_bits
from rds.bus.medium.confinement import ErrorCounters, ErrorState


class Frame(NamedTuple):
    """A frame that waits; tuples of one station sort by arbitration, then by age."""

    priority: int
    number: int  # counts a medium's frames: those of one identifier stay in order
    record: bytes
    endless: bool = False  # sent again as soon as it is through: a babbling node's


class Station:
    """What the medium knows of a node. Times in ns of the bus's time line."""

    __slots__ = (
        "babbling",
        "bits",
        "counters",
        "dead",
        "errors",
        "hung",
        "lost",
        "name",
        "number",
        "plugged",
        "queue",
        "recovering",
        "recovery_from",
        "reports",
        "restart_after",
        "resume_at",
        "sent",
        "told",
        "trying",
    )

    def __init__(self, number: int = 0, name: str = "", reports: bool = False, restart_after: int | None = None):
        self.number = number
        self.name = name or f"node {number}"
        self.reports = reports  # whether it wants error frames
        self.restart_after = restart_after  # ns from bus off to the request for recovery; None: never by itself
        self.queue: list[Frame] = []
        self.counters = ErrorCounters()
        self.plugged = True
        self.dead = False
        self.hung = False
        self.babbling = False
        self.resume_at = 0  # an error-passive sender pauses until then; one plugged in listens until then
        self.recovering = 0  # sequences of recessive bits still to see; 0: it is not recovering
        self.recovery_from = 0
        self.sent = 0  # frames
        self.bits = 0  # of these, interframe space included; 0 on a bus without bits
        self.errors = 0  # frames that it began and that an error broke off
        self.lost = 0  # frames of others that it would have received, and of its own that were dropped
        self.told = (ErrorState.ACTIVE, False)  # state and warning that were last reported
        self.trying = False  # to send, with its plug pulled

    @property
    def on_bus(self) -> bool:
        """Whether its controller takes part: acknowledges, sees errors, may send."""
        return self.plugged and not self.dead and self.counters.state is not ErrorState.OFF

    @property
    def hears(self) -> bool:
        """Whether frames reach its software."""
        return self.plugged and not self.dead and not self.hung and self.counters.state is not ErrorState.OFF

    def push(self, frame: Frame) -> None:
        """Let a frame wait."""
        heappush(self.queue, frame)

    def pop(self) -> Frame:
        """The first in arbitration."""
        return heappop(self.queue)

    def drop_all(self) -> None:
        """Forget what waits."""
        self.lost += sum(not frame.endless for frame in self.queue)
        self.queue.clear()
        self.babbling = False

    def silence(self) -> None:
        """Babble no more."""
        self.babbling = False
        self.queue = sorted(frame for frame in self.queue if not frame.endless)


def priority(identifier: int, extended: bool, remote: bool) -> int:
    """What a frame shows during arbitration, as a number: the lower wins.

    The 11 leading bits, then RTR or SRR, IDE, and an extended frame's other 18 bits and RTR (ISO 11898-1, 10.4.2): a
    data frame goes before a remote frame of its identifier, and both before an extended frame that begins with the same
    11 bits, whose SRR and IDE are recessive.
    """
    if not extended:
        return identifier << 21 | remote << 20
    return identifier >> 18 << 21 | 3 << 19 | (identifier & 0x3FFFF) << 1 | remote


def record_priority(record: bytes) -> int:
    """The same of a wire record."""
    _, identifier, _, flags, _, _ = wire.HEADER.unpack_from(record)
    return priority(identifier, flags & wire.EXTENDED != 0, flags & wire.REMOTE != 0)


def flags_of(record: bytes) -> dict[str, Any]:
    """A wire record's frame in the words of `bits.frame_bits`."""
    _, identifier, _, flags, dlc, length = wire.HEADER.unpack_from(record)
    fd, remote = flags & wire.FD != 0, flags & wire.REMOTE != 0
    return {
        "identifier": identifier,
        "data": record[wire.HEADER.size : wire.HEADER.size + length],
        "extended": flags & wire.EXTENDED != 0,
        "remote": remote,
        "fd": fd,
        "bitrate_switch": fd and flags & wire.BITRATE_SWITCH != 0,
        "error_state": fd and flags & wire.ERROR_STATE != 0,
        "dlc": dlc if remote else None,
    }


def record_bits(record: bytes) -> Bits:
    """How many bits a wire record's frame has."""
    _, identifier, _, flags, _, length = wire.HEADER.unpack_from(record)
    if not flags:  # by far the most frequent kind
        return frame_bits(identifier, record[wire.HEADER.size : wire.HEADER.size + length])
    return frame_bits(**flags_of(record))
