"""Faults on demand, from Python: on the built-in bus, while something runs on it.

    with Faults("mini-cnc") as faults:
        faults.inject("corrupt", node="Y", count=3)
        print(faults.nodes())

The kinds of fault, and what may be said of each, are in fault_kinds.py. See docs/bus-timing.md.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from rds.bus.hub import connect
from rds.bus.medium.fault_kinds import Fault
from rds.core.errors import InputError, MachineError

PATIENCE = 5.0  # s for the hub to answer


class Faults:
    """A line to the hub of `channel`, which must have one: somebody is on the bus.

    Raises MachineError if there is no bus, or it does not answer; InputError for a fault that can't be.
    """

    def __init__(self, channel: str):
        try:
            connection = connect.visit(channel, PATIENCE)
        except (OSError, ValueError) as error:
            raise MachineError(f"bus rds:{channel} can't be reached: {error}") from error
        if connection is None:
            raise MachineError(
                f"there is no bus on channel {channel!r}; start a machine (rds machine serve) or a run first"
            )
        self.channel = channel
        self._connection = connection

    def inject(self, kind: str, **words: Any) -> None:
        """Inject one fault, in the words of `Fault` ("duration" for how long it lasts).

        It stays until it is over or cleared, also when this line is closed.
        """
        self.play([Fault(kind, **words)], own=False)

    def play(self, faults: Iterable[Fault], own: bool = True) -> None:
        """Inject a schedule whose times count from now. With `own`, all of it ends when this line is closed.

        InputError if one is no `Fault`.
        """
        faults = list(faults)
        for fault in faults:
            if not isinstance(fault, Fault):
                raise InputError(f"{fault!r} is no fault: play() takes Fault objects, inject() a kind and its words")
        self._ask("inject", faults=[fault.to_table() for fault in faults], own=own)

    def check_names(self, faults: Iterable[Fault]) -> None:
        """InputError if a fault names a node that is not on the bus now."""
        known = [node["name"] for node in self.nodes()]
        for fault in faults:
            for name in (fault.node, fault.receiver):
                if name is not None and name not in known:
                    raise InputError(
                        f"the fault {fault.kind!r} at {fault.at:g} s is for a node {name!r}, which is not on bus "
                        f"rds:{self.channel}; there are {', '.join(known) or 'none'}"
                    )

    def clear(self) -> None:
        """End all faults: plug in what is unplugged, and so on. Who is dead stays dead."""
        self._ask("clear")

    def restart(self, number: int) -> None:
        """Ask the controller of the node with this number to come back from bus off."""
        self._ask("restart", number=number)

    def nodes(self) -> list[dict[str, Any]]:
        """The nodes on the bus: number, name, state, tec, rec, frames, bits, errors, lost, waiting, and whether
        they are plugged, dead, hung, babbling, recovering."""
        nodes: list[dict[str, Any]] = self._ask("nodes")["nodes"]
        return nodes

    def statistics(self, reset: bool = False) -> dict[str, Any]:
        """What went over the bus, and how late the hub was, since it started or since the last reset.

        bitrate and data_bitrate in bit/s (0: none), seconds, frames, error_frames, load (0 to 1, of the time), struck
        (frames that a fault struck); delivery_lateness (from the end of a frame until the hub handed it on) and
        pickup_lateness (from a node's send until the hub read the frame) as count, p50, p99 and max, µs.
        """
        found: dict[str, Any] = self._ask("statistics", reset=reset)
        return found

    def close(self) -> None:
        """Hang up. Faults that this line owns end."""
        self._connection.sock.close()

    def __enter__(self) -> Faults:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, what: str, **words: Any) -> Any:
        try:
            answer = json.loads(connect.ask(self._connection, json.dumps({"do": what, **words})))
        except OSError as error:
            raise MachineError(f"the hub of channel {self.channel!r} does not answer: {error}") from error
        if isinstance(answer, dict) and "error" in answer:
            raise InputError(f"bus rds:{self.channel}: {answer['error']}")
        return answer
