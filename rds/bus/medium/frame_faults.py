"""Faults that strike frames: which frame is lost, corrupted, delayed or sent twice."""

from __future__ import annotations

import random

from rds.bus.hub import wire
from rds.bus.medium.bits import SECOND
from rds.bus.medium.fault_kinds import ENDLESS, Fault


class _Armed:
    """A fault that waits for its frames."""

    __slots__ = ("chance", "fault", "left", "owner", "until")

    def __init__(self, fault: Fault, now: int, owner: object):
        self.fault = fault
        self.owner = owner
        self.until = ENDLESS if fault.duration is None else now + round(fault.duration * SECOND)
        self.left = fault.count if fault.count is not None else (1 if fault.duration is None else ENDLESS)
        self.chance = None if fault.seed is None else random.Random(fault.seed)

    def strikes(self, sender: str, identifier: int) -> bool:
        """Whether the fault strikes this frame."""
        fault = self.fault
        if fault.node not in (None, sender) or fault.identifier not in (None, identifier):
            return False
        if self.chance is not None and self.chance.random() >= (fault.probability or 0.0):
            return False
        self.left -= 1
        return True


class FrameFaults:
    """The faults that wait for frames. True where there are any."""

    def __init__(self) -> None:
        self._armed: list[_Armed] = []
        self.struck = 0  # frames

    def __bool__(self) -> bool:
        return bool(self._armed)

    def arm(self, fault: Fault, now: int, owner: object = None) -> None:
        """Wait for the frames that `fault` is for, from `now` (ns) on."""
        self._armed.append(_Armed(fault, now, owner))

    def disarm(self, owner: object = None) -> None:
        """Forget the faults of `owner`; None: all."""
        self._armed = [] if owner is None else [armed for armed in self._armed if armed.owner is not owner]

    def delay(self, sender: str, record: bytes, now: int) -> int:
        """How long the frame that `sender` (a name) offers is to wait, ns; 0: not."""
        fault = self._first(True, sender, record, now) if self._armed else None
        return 0 if fault is None else round((fault.by or 0.0) * SECOND)

    def strike(self, sender: str, record: bytes, now: int) -> Fault | None:
        """What befalls the frame that goes over the bus now: to lose, corrupt or duplicate it."""
        return self._first(False, sender, record, now) if self._armed else None

    def _first(self, delays: bool, sender: str, record: bytes, now: int) -> Fault | None:
        identifier = wire.HEADER.unpack_from(record)[1]
        self._armed = [armed for armed in self._armed if now < armed.until]
        for armed in self._armed:
            if (armed.fault.kind == "delay") is delays and armed.strikes(sender, identifier):
                if not armed.left:
                    self._armed.remove(armed)
                self.struck += 1
                return armed.fault
        return None
