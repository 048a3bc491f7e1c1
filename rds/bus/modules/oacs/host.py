"""The host's side: who is on the bus, and the emergency stop of all. One module's commands are in remote.py."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import can

from rds.bus.modules.oacs import messages, messaging
from rds.bus.modules.oacs.codes import NODES, Acknowledges, Code, Kind, Mode
from rds.core.errors import MachineError

WAIT = 0.1  # s for the replies to one call; the slowest board of the thesis took 6.7 ms
_KINDS = {Kind.TRANSLATIONAL: "translational axis", Kind.ROTARY: "rotary axis", Kind.TOOL: "tool"}


@dataclass(frozen=True)
class ModuleInfo:
    """A module as a scan sees it."""

    id: int
    kind: str  # its code: ServM or SpinM
    type: str  # LinrXa, DrillT...
    state: str
    version: int | None = None  # of the dialect; None: it knows the thesis's calls only
    serial: int | None = None
    response_ms: float | None = None  # from the call to the reply in hand
    dialect: str = "oacs"

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def __str__(self) -> str:
        serial = "without serial number" if self.serial is None else f"serial number {self.serial}"
        return f"{self.type or self.kind or 'module'} ({serial})"


def scan(bus: can.BusABC, wait: float = WAIT) -> list[ModuleInfo]:
    """The modules on the bus, by number. It takes three times `wait`, s, and moves nothing.

    Raises MachineError naming both where two modules have one number, or if the bus fails.
    """
    found = survey(bus, wait)
    refuse_clashes(found)
    return found


def survey(bus: can.BusABC, wait: float = WAIT) -> list[ModuleInfo]:
    """What `scan` finds, with every module of a clash.

    Where there is one, the thesis's calls are not sent: two modules of one number could answer them at the same bit
    with different bytes, which neither the bus nor anybody on it can part. The identity call is safe.
    """
    identities = identify(bus, wait)
    if clashes(identities):
        return identities
    kinds = _replies(bus, Code.CALL_ONE, wait)
    types = _replies(bus, Code.CALL_TWO, wait)
    found = []
    for node in sorted({*kinds, *types, *(info.id for info in identities)}):
        known = [info for info in identities if info.id == node]
        # a call's replies carry no serial number: with one module of the number they are its own
        named = sorted(kinds.get(node, {"": None})), sorted(types.get(node, {"": None}))
        for i in range(max(len(known), len(named[0]), len(named[1]))):
            base = known[i] if i < len(known) else ModuleInfo(node, "", "", "unknown")
            found.append(
                ModuleInfo(
                    node,
                    named[0][min(i, len(named[0]) - 1)] or base.kind,
                    named[1][min(i, len(named[1]) - 1)] or base.type,
                    base.state,
                    base.version,
                    base.serial,
                    base.response_ms,
                )
            )
    return found


def identify(bus: can.BusABC, wait: float = WAIT) -> list[ModuleInfo]:
    """The modules that answer the identity call, by number and serial number, clashes included."""
    call = messages.encode("GeneralCall", Code=Code.IDENTITY)
    asked = time.monotonic()
    messaging.send(bus, call)
    found: dict[tuple[int, int], ModuleInfo] = {}
    for message, _, at in messaging.hear_all(bus, wait):
        if message.kind == "Identity":
            fields = message.fields
            found[message.node, fields["Serial"]] = ModuleInfo(
                message.node,
                _KINDS[Kind(fields["KindCode"])],
                "",
                Mode(fields["Mode"]).name.lower(),
                fields["Version"],
                fields["Serial"],
                (at - asked) * 1e3,
            )
    return [found[key] for key in sorted(found)]


def clashes(found: Iterable[ModuleInfo]) -> dict[int, list[ModuleInfo]]:
    """The modules that share a number, by number."""
    by_number: dict[int, list[ModuleInfo]] = {}
    for info in found:
        by_number.setdefault(info.id, []).append(info)
    return {number: infos for number, infos in by_number.items() if len(infos) > 1}


def refuse_clashes(found: Iterable[ModuleInfo]) -> None:
    """MachineError if two modules share a number."""
    for number, infos in clashes(found).items():
        raise MachineError(
            f"module number {number} is used {len(infos)} times: by {' and by '.join(map(str, infos))}; unplug one, "
            f"or give it a number of its own from {NODES[0]} to {NODES[-1]}; nothing moves until then"
        )


def estop(bus: can.BusABC, wait: float = 0.1) -> list[int]:
    """Emergency stop of every module: zero volts, latched. Numbers of those that acknowledged.

    Sent twice, for a frame may be lost. MachineError if the bus fails: then cut the power.
    """
    stopped = set()
    for _ in range(2):
        messaging.send(bus, messages.encode("GeneralCall", Code=Code.EMERGENCY))
        for message, _, _ in messaging.hear_all(bus, wait):
            if message.kind == "Reply" and message.fields.get("Acknowledges") == Acknowledges.EMERGENCY:
                stopped.add(message.fields["BoardID"])
    return sorted(stopped)


def _replies(bus: can.BusABC, call: Code, wait: float) -> dict[int, dict[str, None]]:
    """The texts that answer a general call, by number; two under one number are two modules."""
    messaging.send(bus, messages.encode("GeneralCall", Code=call))
    name, length = ("KindText", 5) if call == Code.CALL_ONE else ("TypeText", 6)
    texts: dict[int, dict[str, None]] = {}
    for message, _, _ in messaging.hear_all(bus, wait):
        if message.kind == "Reply" and message.fields["Code"] == int(call):
            texts.setdefault(message.fields["BoardID"], {})[messages.text(message.fields, name, length)] = None
    return texts
