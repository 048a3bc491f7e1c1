"""A machine reconfigured while the host runs: what the modules that are there now would make, offered with its verdict.

A module that is unplugged stops the machine by itself: the run ends ("machine lost") and the modules' watchdogs cut the
voltage. What is offered here takes effect when it is accepted, as a new machine file; the host goes on with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can

from rds.bus.modules.oacs.events import ModuleEvent, Reconfigurations
from rds.bus.modules.oacs.remote import Module
from rds.core.atomic import write_whole
from rds.core.errors import InputError, MachineError
from rds.machines import Machine, load_machine
from rds.machines.assembly import Order, first_order, judged, machine_text, order_of
from rds.machines.configuration import Verdict

_SLACK = 10.0  # s for a motion beyond twice its time at full speed


@dataclass(frozen=True)
class Offer:
    """Modules in an order, what they say of themselves (by number), and whether they make a machine."""

    order: Order
    data: Mapping[int, Mapping[str, Any]]
    verdict: Verdict


class Offers:
    """Watches the modules on an open `bus`, which nobody else may read meanwhile; `before` is the machine till now."""

    def __init__(self, bus: can.BusABC, before: Machine):
        self._bus = bus
        self._before = before
        self._watching = Reconfigurations(bus, modules=1)
        self._due = False

    def look(self) -> tuple[list[ModuleEvent], Offer | None]:
        """What has happened since the last look, and an offer once all modules have said what they are after a change.

        MachineError if the bus fails.
        """
        happened = self._watching.look()
        self._due |= any(each.event == "ready" for each in happened)
        happened = [each for each in happened if each.event != "ready"]
        if any(each.event in ("added", "removed") for each in happened) and not self._due:
            return happened, None
        offer = self._offer() if self._due else None
        if offer is not None:
            self._due = False
            happened.append(self.now("offered" if offer.verdict.ok else "refused"))
        return happened, offer

    def _offer(self) -> Offer | None:
        try:
            data = {number: Module(self._bus, number).info().as_dict() for number in self._watching.numbers}
        except MachineError:
            return None  # gone meanwhile, or busy: asked again at the next look
        order = order_of(self._before, data) or first_order(data)
        return Offer(order, data, judged(order, data, self._before.name))

    def go_on(self, bus: can.BusABC) -> None:
        """Look on this open bus from now on, which is the same one opened anew; what was there is still known."""
        self._bus = bus
        self._watching.go_on(bus)

    @property
    def numbers(self) -> list[int]:
        """Of the modules that were there at the last look."""
        return self._watching.numbers

    def write(self, offer: Offer, path: Path) -> Machine:
        """The machine of an offer, in a file at `path`; nothing is accepted. InputError for what makes no machine."""
        write_whole(path, machine_text(path.stem, offer.order, offer.data, self._before).encode())
        return load_machine(str(path))

    def accept(self, offer: Offer, path: Path) -> tuple[Machine, ModuleEvent]:
        """Write the machine's file, and go on with it. InputError for what makes no machine."""
        self._before = self.write(offer, path)
        return self._before, self.now("ready")

    def move(self, axis: str, by: float) -> ModuleEvent:
        """Move an axis of the machine by so much, and wait for its end; return when it began to.

        InputError for an axis that the machine does not have, MachineError if its module refuses.
        """
        if axis not in self._before.axes:
            known = ", ".join(self._before.axes)
            raise InputError(f"the machine has no axis {axis!r} to move; it has {known}")
        module = Module(self._bus, self._before.axes[axis].node, axis)
        module.start(by=by)
        moving = self.now("moving", axis)
        slowest = min(module.description.clockwise_speed, module.description.counterclockwise_speed)
        module.wait(_SLACK + 2.0 * 60.0 * abs(by) / max(slowest, 1e-3))
        return moving

    def now(self, event: str, module: str = "") -> ModuleEvent:
        """An event of this moment."""
        return ModuleEvent(self._watching.now, event, module)
