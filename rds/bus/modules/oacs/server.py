"""The distributed modules behind the bus: those of a machine in one process, or each in its own.

`python -m rds.bus.modules.oacs.server MACHINE [--modules X,Z]` writes one line, "ready ...", on stdout when all
modules are on the bus, and reports on stderr. Lines on stdin press buttons and cut wires (`handle`). Its options and
its end are those of rds/bus/modules/server_program.py.
"""

from __future__ import annotations

if __name__ == "__main__":  # a program of our own
    from rds.bus.tools.mf4 import put_off_asammdf
    from rds.core.garbage import collect_rarely

    collect_rarely()
    put_off_asammdf()

import logging
import queue
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from rds.bus.modules import server_program
from rds.bus.modules.oacs import messages
from rds.bus.modules.oacs.module import OacsModule
from rds.bus.modules.oacs.module_data import read_modules
from rds.bus.modules.oacs.node import OacsNode
from rds.bus.modules.serve_loop import Opener, serve_nodes
from rds.bus.tools.link import BUILTIN
from rds.core.errors import InputError
from rds.core.garbage import leave
from rds.core.private_files import keep_process_private
from rds.machines import Machine
from rds.machines.machine import Axis

LOG = logging.getLogger(__name__)


def serve(
    machine: Machine,
    interface: str = BUILTIN,
    channel: str | None = None,
    axes: Sequence[str] | None = None,
    ready: Callable[[], Any] | None = None,
    stop: threading.Event | None = None,
    lines: queue.SimpleQueue[str] | None = None,
    serials: Mapping[str, int] | None = None,
    **options: Any,
) -> None:
    """Serve the modules of `machine` (or of its `axes`). What else may be said, and errors: as `serve_nodes`.

    `lines` are what hands do at the machine (`handle`); `serials` are the modules' serial numbers, by name, random
    where not given. InputError also for a module's data that cannot be.
    """
    data = read_modules(machine)
    messages.load()  # half a second, which must not fall between two cycles
    lines = lines or queue.SimpleQueue()
    make_node = partial(_make_node, machine, data, serials or {})
    serve_nodes(
        *(machine, make_node, interface, channel, axes, ready, stop),
        chores=partial(_do_lines, lines),
        exact=True,  # as response times are
        **options,
    )


def _make_node(
    machine: Machine,
    data: Mapping[str, Any],
    serials: Mapping[str, int],
    slot: int,
    axis: Axis,
    opener: Opener,
) -> OacsNode:
    def make(start: float) -> OacsModule:
        own, period = serials.get(axis.name), machine.sample_period
        return OacsModule(axis, data[axis.name], slot, period, start, own, machine.converter.range)

    return OacsNode(axis.name, make, opener)


def _do_lines(lines: queue.SimpleQueue[str], nodes: Sequence[OacsNode]) -> None:
    for _ in range(lines.qsize()):  # and no more: a flood of lines must not stop the modules
        try:
            handle(lines.get(), nodes)
        except InputError as error:
            LOG.error("%s", error)


def main(arguments: Sequence[str] | None = None) -> int:
    """The program. Exit code 0: told to end; 1: the bus failed at the start; 2: bad input."""
    lines = queue.SimpleQueue[str]()
    with_hands = partial(serve, lines=lines)
    return server_program.run(with_hands, "rds.bus.modules.oacs.server", "serve distributed modules", arguments, lines)


_WIRES = {"broken": False, "bridged": True, "whole": None}
_SIDES = {"low": -1, "high": 1}
_BUTTON = {"on": True, "off": False}


def handle(line: str, nodes: Iterable[OacsNode]) -> None:
    """Do what a line says. InputError if it says nothing that can be done."""
    by_number = {str(node.module.node): node for node in nodes}
    words = line.split()
    if len(words) != 3 or words[0] not in by_number:
        raise InputError(
            f"line {line.strip()!r} must be a module ({', '.join(by_number)}), then 'emergency on|off' "
            "or 'low|high broken|bridged|whole'"
        )
    node, what, how = by_number[words[0]], words[1], words[2]
    now = node.clock.now()
    if what == "emergency" and how in _BUTTON:
        node.module.set_emergency_input(_BUTTON[how], now)
    elif what in _SIDES and how in _WIRES:
        if not node.module.plant.switches:
            raise InputError(f"module {words[0]} has no limit switches")
        node.module.set_wire(_SIDES[what], _WIRES[how], now)
    else:
        raise InputError(f"{what} {how} is nothing that can be done to a module; see rds/bus/modules/oacs/server.py")


if __name__ == "__main__":
    keep_process_private()
    leave(main())
