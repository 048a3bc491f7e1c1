"""The hands at a virtual machine's emergency stop buttons, as lines of text: "2 emergency on", "2 emergency off"."""

from __future__ import annotations

import logging
import queue
from collections.abc import Sequence
from typing import Protocol

import can

LOG = logging.getLogger(__name__)

_BUTTON = {"on": True, "off": False}


class HasButton(Protocol):
    """A module with an emergency stop button."""

    @property
    def number(self) -> int:
        """Its node."""

    def press(self, active: bool) -> None:
        """Press or release it. can.CanError if the bus fails; the module has stopped even so."""


def press_buttons(lines: queue.SimpleQueue[str], nodes: Sequence[HasButton]) -> None:
    """Do what the lines say that wait; what can't be done is reported in the log."""
    by_number = {str(node.number): node for node in nodes}
    for _ in range(lines.qsize()):  # and no more: a flood of lines must not stop the modules
        line = lines.get()
        words = line.split()
        if len(words) != 3 or words[0] not in by_number or words[1] != "emergency" or words[2] not in _BUTTON:
            LOG.error("line %r must be a module (%s), then 'emergency on|off'", line, ", ".join(by_number))
            continue
        try:
            by_number[words[0]].press(_BUTTON[words[2]])
        except (can.CanError, OSError) as error:
            LOG.error("module %s has stopped, and could not tell the others: %s", words[0], error)
