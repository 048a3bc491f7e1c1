"""Everybody on a bus, whatever they speak: cyclic modules, distributed modules, drives."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import can

from rds.bus.modules.rds import frames
from rds.bus.tools.link import BUILTIN, open_bus
from rds.bus.tools.listening import frames_within
from rds.core.errors import MachineError

_WAIT = 0.2  # s for the answers to the cyclic call

Row = dict[str, Any]  # id, type, dialect, version, state; what else a dialect tells


def scan_all(interface: str = BUILTIN, channel: str | None = None, **options: Any) -> list[Row]:
    """Each module and drive that answers on a bus; nothing moves. It takes about a second.

    `options` go to the interface as they are (bitrate, ...).

    MachineError naming both modules of a number that is used twice, for a bus on which nobody answers but frames of
    modules are seen, and where the bus fails.
    """
    opened = partial(open_bus, interface, channel, **options)
    distributed = _distributed(opened)
    rows = [
        *_cyclic(opened, {row["id"]: row for row in distributed}),
        *distributed,
        *_drives(interface, channel, options),
    ]
    if not rows:
        from rds.bus.tools.traffic import refuse_taken

        with opened() as bus:
            refuse_taken(bus)
    return rows


def _distributed(opened: Callable[[], can.BusABC]) -> list[Row]:
    from rds.bus.modules.oacs.host import scan

    with opened() as bus:
        return [info.as_dict() for info in scan(bus)]


def _cyclic(opened: Callable[[], can.BusABC], distributed: dict[int, Row]) -> list[Row]:
    """Modules that answer the cyclic call and speak no other dialect: those of `rds machine serve`.

    The distributed modules take cyclic commands as well. MachineError naming both modules of a clash.
    """
    from rds.bus.modules.rds.identity import clash, listen, refuse_clashes

    with opened() as bus:
        identities = listen(bus).modules
        refuse_clashes(identities)
        for identity in identities:
            if other := distributed.get(identity.node):
                names = [str(identity), f"distributed module {other['type']} with serial number {other['serial']}"]
                raise MachineError(clash(f"number {identity.node}", names))
        bus.send(can.Message(arbitration_id=frames.CALL, is_extended_id=False, data=b""), 0.5)
        answers = {frames.answer_identifier(node): node for node in frames.NODES}
        found: dict[int, Row] = {}
        for message in frames_within(bus, _WAIT):
            if message.is_extended_id or message.is_error_frame or len(message.data) != 8:
                continue
            node = answers.get(message.arbitration_id)
            if node is not None and node not in distributed:
                status = frames.decode_answer(message.arbitration_id, message.data).status
                found[node] = {"id": node, "type": "axis", "dialect": "rds", "version": None, "state": _state(status)}
        return [found[node] for node in sorted(found)]


def _state(status: int) -> str:
    state = (frames.Status(status).name or "none").lower()
    return state.replace("|", ", ").replace("_", " ").replace("none", "idle")


def _drives(interface: str, channel: str | None, options: dict[str, Any]) -> list[Row]:
    from rds.bus.modules.cia402.scan import scan

    return [
        {
            "id": device.node,
            "type": device.name or device.kind,
            "dialect": "cia402" if device.is_drive else "canopen",
            "version": device.version,
            "state": device.state.name.lower().replace("_", " ") if device.state is not None else None,
        }
        for device in scan(interface, channel, **options)
    ]
