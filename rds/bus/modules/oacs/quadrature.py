"""Counting an encoder's edges by interrupts, as a small processor does: by table 13, and losing some if it is slow.

Channels A and B of the encoder are a quarter of a period apart. Clockwise, A leads: A rises while B is low. Each edge
asks for an interrupt, whose service reads both channels and counts by table 13 (oacs-thesis 7.6),

    edge of A: clockwise if B is low where A has risen, high where A has fallen       (A and B differ)
    edge of B: clockwise if A is high where B has risen, low where B has fallen       (A and B agree)

so that each of the four edges of a period counts. (The thesis's table has the rising edges; its text has B leading
clockwise, which contradicts the table and its code, so the table holds.)

The processor serves one interrupt at a time, for `service` s, and remembers one more of each channel. An edge whose
channel is remembered already is lost. A service that comes late, when the other channel has moved on, reads levels
that do not belong to its edge and counts the wrong way. A managed runtime serves nothing at all for `pause` s in
every `every` s. While no more than one edge falls into a pause nothing is lost; with two or more, all of them are.
"""

from __future__ import annotations

from collections import deque
from math import floor
from typing import NamedTuple


class Interrupts(NamedTuple):
    """How quickly a processor serves interrupts, s."""

    service: float = 4e-6
    pause: float = 0.0
    every: float = 0.0


def levels(count: int) -> tuple[bool, bool]:
    """Channels A and B where the code wheel has passed `count` edges."""
    quarter = count % 4
    return quarter in (1, 2), quarter in (2, 3)


def decode(channel: str, a: bool, b: bool) -> int:
    """What a service counts for an edge of `channel` that finds these levels: +1 clockwise, -1 counter-clockwise."""
    return 1 if (a != b) == (channel == "A") else -1


class Counter:
    """The recorded count beside the true one. `start` is the time now, s, at which both are `count`."""

    def __init__(self, interrupts: Interrupts, count: int = 0, start: float = 0.0, counts_per_turn: int = 1024):
        self.interrupts = interrupts
        self.true = count
        self.recorded = count
        self.lost = 0  # edges that asked for no interrupt
        self.missing = 0  # counts found missing between index pulses, as a module can
        self._turn = counts_per_turn
        self._index: tuple[int, int] | None = None  # number of the last index pulse, and what was recorded there
        self._start = start
        self._free = start  # when the processor has time
        self._waiting: deque[tuple[str, float]] = deque()  # channel, and when its edge came

    def move(self, before: float, after: float, since: float, until: float) -> None:
        """The wheel turned evenly from `before` to `after` counts (real numbers) in the time from `since` to `until`.

        The true count is the nearest whole one. Times in s, not before those of the last call.
        """
        goal = floor(after + 0.5)
        if goal == self.true:
            if self._waiting:
                self._serve(until)
            return
        step = 1 if goal > self.true else -1
        span = after - before
        while self.true != goal:
            edge = self.true + 0.5 * step  # where the count changes
            share = min(max((edge - before) / span, 0.0), 1.0) if span else 1.0
            self._edge(step, since + share * (until - since))
        self._serve(until)

    def set(self, count: int) -> None:
        """The axis is at this count here (homing, or a zero set by hand); the code wheel stays where it is."""
        self.recorded = count
        self._index = None

    def _edge(self, step: int, at: float) -> None:
        self._serve(at)
        before = levels(self.true)
        self.true += step
        channel = "A" if before[0] != levels(self.true)[0] else "B"
        if any(channel == waiting for waiting, _ in self._waiting):
            self.lost += 1
        elif self._waiting or self._awake(max(at, self._free)) > at:
            self._waiting.append((channel, at))
        else:
            self.recorded += decode(channel, *levels(self.true))
            self._free = at + self.interrupts.service
        if self._turn and self.true % self._turn == 0:
            self._pass_index(self.true // self._turn)

    def _serve(self, until: float) -> None:
        """Serve what waits, as long as service begins by `until`."""
        while self._waiting:
            channel, at = self._waiting[0]
            begins = self._awake(max(at, self._free))
            if begins > until:
                return
            self._waiting.popleft()
            self.recorded += decode(channel, *levels(self.true))
            self._free = begins + self.interrupts.service

    def _awake(self, at: float) -> float:
        """The first time from `at` on at which the runtime serves interrupts."""
        _, pause, every = self.interrupts
        if not pause or not every:
            return at
        into = (at - self._start) % every
        return at + (pause - into) if into < pause else at

    def _pass_index(self, number: int) -> None:
        """The index pulse comes once per turn: between two of them a turn's counts must have been recorded."""
        if self._index is not None:
            before, recorded = self._index
            if number != before:
                self.missing += self._turn - abs(self.recorded - recorded)
        self._index = number, self.recorded


def highest_rate(interrupts: Interrupts) -> float:
    """Counts per second up to which nothing is lost, however they fall: one edge at most in any pause."""
    return 1.0 / max(interrupts.pause + interrupts.service, interrupts.service)
