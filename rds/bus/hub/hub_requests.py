"""Questions to the hub: who is not a node asks here how the bus is, and has faults injected.

A question is a JSON object with "do": "nodes", "statistics", "inject", "clear" or "restart"; the answer is one with
"error" if it was refused. What an asker has injected with "own" ends when its connection does.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from rds.bus.hub.hub_node import Node
from rds.bus.hub.lateness import Lateness
from rds.bus.medium.fault_kinds import Fault
from rds.bus.medium.injector import Injector
from rds.bus.medium.medium import FaultRefused, Medium
from rds.bus.medium.station import Station
from rds.core.errors import InputError

_LONGEST_QUESTION = 1 << 20  # bytes


class Requests:
    """Answers for one medium. `delivery` and `pickup` are the hub's lateness, see Hub."""

    def __init__(self, medium: Medium[Node], note: Callable[[str], None], now: int):
        self._medium = medium
        self._injector: Injector[Node] = Injector(medium, note)
        self._since = now
        self._busy_before = 0
        self._frames_before = 0
        self._errors_before = 0
        self._struck_before = 0
        self.delivery = Lateness()
        self.pickup = Lateness()
        self._actions: dict[str, Callable[[dict[str, Any], Node, int], Any]] = {
            "nodes": self._nodes,
            "statistics": self._statistics,
            "inject": self._inject,
            "clear": self._clear,
            "restart": self._restart,
        }

    def answer(self, question: str, asker: Node, now: int) -> str:
        """The answer to one question."""
        try:
            if len(question) > _LONGEST_QUESTION:
                raise InputError("this is too much at once (more than 1 MiB); give the schedule in parts")
            asked = json.loads(question)
            action = self._actions.get(str(asked.get("do"))) if isinstance(asked, dict) else None
            if action is None:
                raise InputError(f"the hub is asked to do one of {', '.join(self._actions)}")
            return json.dumps(action(asked, asker, now))
        except (FaultRefused, InputError) as error:
            return json.dumps({"error": str(error)})
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            return json.dumps({"error": f"this makes no sense to the hub: {error}"})

    def take_part(self, asker: Node, part: bytes, more: bool) -> str | None:
        """Put a question together; None until it is whole."""
        if len(asker.question) <= _LONGEST_QUESTION:  # the rest of one that is refused anyway is not kept
            asker.question += part
        if more:
            return None
        question, asker.question = asker.question, b""
        return question.decode(errors="replace")

    def forget(self, asker: Node, now: int) -> None:
        """The asker has gone, and with it the faults that it owned."""
        self._injector.withdraw(asker, now)

    def _inject(self, asked: dict[str, Any], asker: Node, now: int) -> dict[str, Any]:
        faults = [Fault.from_table(table) for table in asked["faults"]]
        self._injector.inject(faults, now, asker if asked.get("own") else None)
        return {"injected": len(faults)}

    def _clear(self, asked: dict[str, Any], asker: Node, now: int) -> dict[str, Any]:
        self._injector.withdraw(None, now)
        return {}

    def _restart(self, asked: dict[str, Any], asker: Node, now: int) -> dict[str, Any]:
        for node, station in self._medium.stations.items():
            if station.number == asked["number"]:
                self._medium.restart(node, now)
                return {}
        raise FaultRefused(f"there is no node {asked['number']} on this bus")

    def _nodes(self, asked: dict[str, Any], asker: Node, now: int) -> dict[str, Any]:
        return {"nodes": [_description(station) for station in self._medium.stations.values()]}

    def _statistics(self, asked: dict[str, Any], asker: Node, now: int) -> dict[str, Any]:
        medium = self._medium
        elapsed = max(1, now - self._since)
        found = {
            "bitrate": medium.bitrate,
            "data_bitrate": medium.data_bitrate or 0,
            "seconds": elapsed * 1e-9,
            "frames": medium.frames - self._frames_before,
            "error_frames": medium.errors - self._errors_before,
            "load": (medium.busy - self._busy_before) / elapsed,
            "struck": medium.frame_faults.struck - self._struck_before,
            "delivery_lateness": self.delivery.summary(),
            "pickup_lateness": self.pickup.summary(),
        }
        if asked.get("reset"):
            self._since = now
            self._busy_before, self._frames_before = medium.busy, medium.frames
            self._errors_before, self._struck_before = medium.errors, medium.frame_faults.struck
            self.delivery.reset()
            self.pickup.reset()
        return found


def _description(station: Station) -> dict[str, Any]:
    counters = station.counters
    return {
        "number": station.number,
        "name": station.name,
        "state": counters.state.words,
        "tec": counters.tec,
        "rec": counters.rec,
        "frames": station.sent,
        "bits": station.bits,
        "errors": station.errors,
        "lost": station.lost,
        "waiting": len(station.queue),
        "plugged": station.plugged,
        "dead": station.dead,
        "hung": station.hung,
        "babbling": station.babbling,
        "recovering": bool(station.recovering),
    }
