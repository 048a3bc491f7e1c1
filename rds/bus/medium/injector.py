"""The hub's hand in faults: it injects them, at their time, into the medium, and lifts them again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Generic

from rds.bus.medium.bits import SECOND
from rds.bus.medium.fault_kinds import FRAME_KINDS, KINDS, Fault
from rds.bus.medium.medium import FaultRefused, Medium, Node


class Injector(Generic[Node]):
    """Injects faults into one medium; `note` takes a sentence on each that comes to nothing."""

    def __init__(self, medium: Medium[Node], note: Callable[[str], None]):
        self._medium = medium
        self._note = note
        self._lifts: dict[tuple[Node, str], tuple[object, Callable[[int], None]]] = {}
        self._waiting: dict[object, object] = {}  # owners of the faults whose time has not come, by a token of each

    def inject(self, faults: Sequence[Fault], now: int, owner: object = None) -> None:
        """Inject `faults`, each at its time after `now` (ns). Those of an `owner` end with withdraw(owner).

        FaultRefused if the bus can't have one of them, or if a fault that is due at once names no node on it; then
        none is injected. What a later one finds missing when it is due is noted.
        """
        for fault in faults:
            if KINDS[fault.kind].needs_bits and not self._medium.bitrate:
                raise FaultRefused(
                    f"{fault.kind!r} needs a bus with bit timing (this one is untimed): open it with a bitrate"
                )
            if fault.at == 0:
                self._check_names(fault)
        for fault in faults:
            if fault.at == 0:
                self._begin(fault, owner, now)
            else:
                token = object()
                self._waiting[token] = owner
                self._medium.at(now + round(fault.at * SECOND), partial(self._begin_later, fault, token))

    def withdraw(self, owner: object, now: int) -> None:
        """End what `owner` has injected, what is still to come too; None: all. Who is dead stays dead."""
        for token, its_owner in list(self._waiting.items()):
            if owner is None or its_owner is owner:
                del self._waiting[token]
        self._medium.frame_faults.disarm(owner)
        for key, (its_owner, lift) in list(self._lifts.items()):
            if owner is None or its_owner is owner:
                del self._lifts[key]
                lift(now)

    def _begin_later(self, fault: Fault, token: object, time: int) -> None:
        if token not in self._waiting:
            return
        owner = self._waiting.pop(token)
        try:
            self._check_names(fault)
            self._begin(fault, owner, time)
        except FaultRefused as refusal:
            self._note(f"the fault {fault.to_table()} came to nothing: {refusal}")

    def _begin(self, fault: Fault, owner: object, now: int) -> None:
        if fault.kind in FRAME_KINDS:
            self._medium.frame_faults.arm(fault, now, owner)
            return
        for node in self._named(fault.node):
            self._begin_at(node, fault, owner, now)

    def _begin_at(self, node: Node, fault: Fault, owner: object, now: int) -> None:
        medium = self._medium
        if fault.kind == "die":
            medium.die(node, now)
        elif fault.kind == "restart":
            medium.restart(node, now)
        elif fault.kind == "plug":
            self._lifts.pop((node, "unplug"), None)
            medium.plug(node, now)
        elif fault.kind == "unplug":
            medium.unplug(node, now)
            self._until(node, fault, owner, now, partial(medium.plug, node))
        elif fault.kind == "hang":
            medium.hang(node, now)
            self._until(node, fault, owner, now, partial(medium.wake, node))
        else:
            medium.babble(node, fault.identifier or 0, now)
            self._until(node, fault, owner, now, partial(medium.silence, node))

    def _until(self, node: Node, fault: Fault, owner: object, now: int, lift: Callable[[int], None]) -> None:
        """Lift the fault of a node when its time is over, or when it is withdrawn, whichever comes first."""
        key = (node, fault.kind)

        def safely(time: int) -> None:
            if node in self._medium.stations:
                lift(time)

        entry = (owner, safely)
        self._lifts[key] = entry
        if fault.duration is not None:

            def over(time: int) -> None:
                if self._lifts.get(key) is entry:
                    del self._lifts[key]
                    safely(time)

            self._medium.at(now + round(fault.duration * SECOND), over)

    def _check_names(self, fault: Fault) -> None:
        for name in (fault.node, fault.receiver):
            if name is not None:
                self._named(name)

    def _named(self, name: str | None) -> list[Node]:
        found = [node for node, station in self._medium.stations.items() if station.name == name]
        if not found:
            known = ", ".join(station.name for station in self._medium.stations.values()) or "nobody"
            raise FaultRefused(f"no node is called {name!r}; on the bus: {known}")
        return found
