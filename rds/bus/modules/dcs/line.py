"""The line between host and units: two pairs of wires, on which a byte takes ten bits' time; noise, and a cut cable.

Everything happens at instants that are handed in (s), so the same line goes in virtual time, and in a server's.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import count
from math import inf
from random import Random

from rds.bus.modules.dcs.frames import byte_time
from rds.bus.modules.dcs.unit import Sent, Unit

_ROUNDING = 1e-9  # s


@dataclass
class Pair:
    """One direction of the line: when it is free again, and what went over it."""

    byte: float  # s
    free: float = 0.0
    bytes: int = 0
    busy: float = 0.0  # s
    damaged: int = 0

    def begin(self, at: float, size: int) -> list[float]:
        """The instants at which `size` bytes are whole that are to be sent from the instant `at` on."""
        first = max(at, self.free)
        self.free = first + size * self.byte
        self.bytes += size
        self.busy += size * self.byte
        return [first + (i + 1) * self.byte for i in range(size)]


@dataclass
class FieldLine:
    """Units on a line of `baud`; `noise` is the share of bytes in which a bit turns, `cut` that nothing gets through.

    `watch` is called every `every` s with the instant and the carriages' true positions, as dial gauges would show.
    """

    units: Sequence[Unit]
    baud: float
    noise: float = 0.0
    seed: int = 1
    cut: bool = False
    watch: Callable[[float, list[float]], None] | None = None
    every: float = 1e-3
    down: Pair = field(init=False)
    up: Pair = field(init=False)

    def __post_init__(self) -> None:
        self.down, self.up = Pair(byte_time(self.baud)), Pair(byte_time(self.baud))
        self.units = list(self.units)
        self._random = Random(self.seed)
        self._order = count()
        self._coming: list[tuple[float, int, int]] = []  # bytes to the units
        self._sending: list[tuple[float, int, bytes]] = []  # what units are going to send
        self._delivered: list[tuple[float, int, int]] = []  # bytes to the host
        self.next_look = inf if self.watch is None else 0.0

    def write(self, data: bytes, at: float) -> float:
        """The host sends at the instant `at`; the instant at which its last byte is whole."""
        instants = self.down.begin(at, len(data))
        for byte, instant in zip(data, instants, strict=True):
            self._put(self._coming, byte, instant, self.down)
        return instants[-1] if instants else at

    def _put(self, heap: list[tuple[float, int, int]], byte: int, instant: float, pair: Pair) -> None:
        if self.cut:
            return
        if self.noise and self._random.random() < self.noise:
            byte ^= 1 << self._random.randrange(8)
            pair.damaged += 1
        heapq.heappush(heap, (instant, next(self._order), byte))

    @property
    def due(self) -> float:
        """The next instant at which something happens that the host does not do."""
        return min(self._units_due(), self._delivered[0][0] if self._delivered else inf)

    def _units_due(self) -> float:
        return min(
            self._coming[0][0] if self._coming else inf,
            self._sending[0][0] if self._sending else inf,
            min((unit.due for unit in self.units), default=inf),
            self.next_look,
        )

    def advance(self, until: float) -> bytes:
        """Let time pass until the instant `until`; the bytes that have reached the host."""
        while (now := self._units_due()) <= until:
            if self.next_look <= now:
                assert self.watch is not None
                self.watch(now, self.positions(now))
                self.next_look = max(now, self.next_look) + self.every
            elif self._sending and self._sending[0][0] <= now:
                self._transmit()
            elif self._coming and self._coming[0][0] <= now:
                instant, _, byte = heapq.heappop(self._coming)
                for unit in self.units:
                    self._queue(unit.receive(byte, instant))
            else:
                for unit in self.units:
                    if unit.due <= now:
                        self._queue(unit.expire(now))
        found = bytearray()
        while self._delivered and self._delivered[0][0] <= until:
            found.append(heapq.heappop(self._delivered)[2])
        return bytes(found)

    def _queue(self, sent: Sent) -> None:
        for at, data in sent:
            heapq.heappush(self._sending, (at, next(self._order), data))

    def _transmit(self) -> None:
        """A unit begins to send; where another one sends still, neither is understood from there on."""
        at, _, data = heapq.heappop(self._sending)
        if at < self.up.free - _ROUNDING:
            data = bytes(byte ^ 0xA5 for byte in data)
        for byte, instant in zip(data, self.up.begin(at, len(data)), strict=True):
            self._put(self._delivered, byte, instant, self.up)

    def positions(self, at: float) -> list[float]:
        """Where the carriages really are, axis units."""
        return [unit.position(at) for unit in self.units]

    def unit(self, number: int) -> Unit | None:
        """The unit with this number, if it is there."""
        return next((unit for unit in self.units if unit.number == number), None)

    def remove(self, number: int, at: float) -> None:
        """A unit dies: its motor stands, and it hears nothing."""
        for unit in self.units:
            if unit.number == number:
                unit.motor.stop(at)
        self.units = [unit for unit in self.units if unit.number != number]
