"""Which modules of the cyclic frames are on a bus: each says its node and a serial number of its own.

The answers are extended frames whose identifiers differ even where two modules have one node, so none is lost in a
collision. What else is heard meanwhile tells whether a host commands the bus already.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import can

from rds.bus.modules.rds import frames
from rds.bus.modules.rds.frames import Identity
from rds.bus.tools.link import bus_failed
from rds.bus.tools.listening import frames_within
from rds.core.errors import MachineError
from rds.machines.machine import Axis

WAIT = 0.1  # s for all answers
_COMMANDS = (frames.COMMAND, frames.DRY_COMMAND)


@dataclass
class IdentityAnswers:
    """Who answered, and how many commands of another host went by."""

    modules: list[Identity] = field(default_factory=list)
    commands: int = 0


def listen(bus: can.BusABC, wait: float = WAIT) -> IdentityAnswers:
    """Call all modules, and listen for `wait` s; nothing moves. MachineError if the bus fails.

    `bus` must let extended frames and commands through. On a bus with bit timing where nobody is, nobody is heard.
    """
    heard = IdentityAnswers()
    found: set[Identity] = set()
    try:
        bus.send(can.Message(arbitration_id=frames.CALL, is_extended_id=False, data=frames.WHO), wait)
        for message in frames_within(bus, wait):
            if message.is_error_frame or message.is_remote_frame or not message.is_rx:
                continue
            if not message.is_extended_id:
                heard.commands += message.arbitration_id in _COMMANDS
            elif identity := frames.decode_identity(message.arbitration_id, message.data):
                found.add(identity)
    except can.CanTimeoutError:  # nobody acknowledges where nobody is
        pass
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error
    heard.modules = sorted(found)
    return heard


def refuse_clashes(found: Iterable[Identity]) -> None:
    """MachineError naming the modules that share a node, if there are any."""
    by_node: dict[int, list[str]] = {}
    for identity in found:
        by_node.setdefault(identity.node, []).append(str(identity))
    for node, names in by_node.items():
        if len(names) > 1:
            raise MachineError(clash(f"node {node}", names))


def refuse_others(found: Iterable[Identity], axes: Iterable[Axis], range: float) -> None:
    """MachineError for a module of `axes` whose firmware or axis is another one: its counts mean something else."""
    by_node = {axis.node: axis for axis in axes}
    for identity in found:
        axis = by_node.get(identity.node)
        if axis is None:
            continue
        if identity.version != frames.VERSION:
            raise MachineError(
                f"{axis.name} (node {axis.node}): the {identity} speaks version {identity.version} of these frames, "
                f"and this host version {frames.VERSION}; update the older one"
            )
        if identity.scale and identity.scale != frames.scale(axis.unit, axis.resolution, range):
            raise MachineError(
                f"{axis.name} (node {axis.node}): the {identity} is another machine's, or of another axis: it does not "
                f"count {axis.resolution:g} {axis.unit} at ±{range:g} V, as the machine's file says; connect, serve or "
                "program the right one"
            )


def clash(where: str, names: Iterable[str]) -> str:
    """What to say where several devices share an identifier."""
    named = list(names)
    return (
        f"{where} is used {len(named)} times: by {' and by '.join(named)}; unplug one, stop its process, or give it "
        "a number of its own; nothing moves until then"
    )
