"""The hands at the virtual machine: buttons and wires of its modules, as lines of text.

4 emergency on|off          the module's emergency stop button
4 low|high broken|bridged|whole     the wire of a limit switch
"""

from __future__ import annotations

from collections.abc import Iterable

from rds.bus.oacs.node import OacsNode
from rds.core.errors import InputError

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
        raise InputError(f"{what} {how} is nothing that can be done to a module; see rds/bus/oacs/bench.py")
