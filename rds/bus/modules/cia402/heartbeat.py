"""Heartbeats of a drive: its own (0x1017), and those of others that it waits for (0x1016). CiA 301, 7.2.8.3.2."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import inf

from canopen.sdo import SdoAbortedError

from rds.bus.modules.cia402.codes import Abort
from rds.bus.modules.cia402.dictionary import Dictionary

_PLACES = (1, 2)  # sub-indices of 0x1016


class Heartbeats:
    """When to send, and who is missing. `now()` gives the instant of bus time, s."""

    def __init__(self, objects: Dictionary, now: Callable[[], float]):
        self._objects, self._now = objects, now
        self._next = inf
        self._deadlines: dict[int, float] = {}  # node -> instant by which it has to be heard again
        self._missing: set[int] = set()
        objects.writers[0x1017, 0] = self._set_period
        for place in _PLACES:
            objects.writers[0x1016, place] = partial(self._watch, place)

    @property
    def watched(self) -> dict[int, float]:
        """Node -> time in s within which its heartbeats are expected."""
        entries = [self._objects.values[0x1016, place] for place in _PLACES]
        return {
            entry >> 16 & 0x7F: (entry & 0xFFFF) * 1e-3 for entry in entries if entry >> 16 & 0x7F and entry & 0xFFFF
        }

    @property
    def is_one_missing(self) -> bool:
        """Whether a watched node has fallen silent."""
        return bool(self._missing)

    def restart(self) -> None:
        """After boot-up: send again as 0x1017 says, and wait for the first heartbeat of each watched node."""
        self._deadlines, self._missing = {}, set()
        self._set_period(self._objects[0x1017])

    def heard(self, node: int) -> bool:
        """A heartbeat of a watched node came; returns whether it had been missing."""
        self._deadlines[node] = self._now() + self.watched[node]
        was_missing = node in self._missing
        self._missing.discard(node)
        return was_missing

    def deadline(self) -> float:
        """The next instant at which to send, or at which a node is missing, s; infinite if there is none."""
        return min([self._next, *self._deadlines.values()]) if self._deadlines else self._next

    def due(self) -> bool:
        """Whether to send now."""
        if self._now() < self._next:
            return False
        period = self._objects[0x1017] * 1e-3
        self._next += period
        if self._next < self._now():  # after a long sleep, one will do
            self._next = self._now() + period
        return True

    def lost(self) -> bool:
        """Whether a node has just gone missing."""
        late = [node for node, instant in self._deadlines.items() if instant <= self._now()]
        for node in late:
            del self._deadlines[node]
            self._missing.add(node)
        return bool(late)

    def _set_period(self, milliseconds: int) -> None:
        self._next = self._now() + milliseconds * 1e-3 if milliseconds else inf

    def _watch(self, place: int, value: int) -> None:
        node, time = value >> 16 & 0x7F, value & 0xFFFF
        if value >> 24 or value >> 16 & 0x80:
            raise SdoAbortedError(Abort.VALUE)
        others = [self._objects.values[0x1016, other] for other in _PLACES if other != place]
        if node and time and any(other >> 16 & 0x7F == node and other & 0xFFFF for other in others):
            raise SdoAbortedError(Abort.PARAMETERS_INCOMPATIBLE)  # one time for each node
        before = self._objects.values[0x1016, place] >> 16 & 0x7F
        self._deadlines.pop(before, None)
        self._missing.discard(before)
