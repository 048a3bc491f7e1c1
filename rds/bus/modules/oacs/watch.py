"""Watching who is on the bus while the machine runs: a module that appears or disappears is noticed within a second."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

import can

from rds.bus.modules.oacs.host import ModuleInfo, clashes, identify, survey
from rds.core.errors import MachineError

LOG = logging.getLogger(__name__)

INTERVAL = 0.15  # s from the end of one call to the next
ANSWERS = 0.05  # s for answers to a call
PATIENCE = 3  # calls without an answer until a module counts as gone


class Change(Enum):
    """What happened."""

    APPEARED = "appeared"
    DISAPPEARED = "disappeared"
    CLASH = "shares its number with another"
    BUS_LOST = "the bus failed"


class Event(NamedTuple):
    """A change; `module` is None where the bus itself failed, and `text` says why."""

    change: Change
    module: ModuleInfo | None
    text: str = ""


class Watch:
    """Calls all modules every `INTERVAL` on a bus of its own, and gives every change to `tell`.

    By hand: `events = watch.look()`. In the background: `with Watch(bus, tell): ...`, where `tell` is called in the
    watching thread. A bus that fails ends the watch with the event BUS_LOST: it never dies silently.
    """

    def __init__(self, bus: can.BusABC, tell: Callable[[Event], None] | None = None, interval: float = INTERVAL):
        self._bus = bus
        self._tell = tell or (lambda event: None)
        self._interval = interval
        self._silent: dict[tuple[int, int | None], int] = {}  # calls that it has not answered
        self._known: dict[tuple[int, int | None], ModuleInfo] = {}
        self._clashing: set[int] = set()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def go_on(self, bus: can.BusABC) -> None:
        """Call on this open bus from now on; not while it watches in the background."""
        self._bus = bus

    @property
    def modules(self) -> list[ModuleInfo]:
        """Those that are there."""
        return [self._known[key] for key in sorted(self._known)]

    def look(self) -> list[Event]:
        """Call once and return what changed; some 0.05 s, more when somebody is new. MachineError: the bus failed."""
        here = {(info.id, info.serial): info for info in identify(self._bus, ANSWERS)}
        events = []
        if set(here) - set(self._known):
            named = {(info.id, info.serial): info for info in survey(self._bus)}
            for key in sorted(set(here) - set(self._known)):
                self._known[key] = named.get(key, here[key])
                events.append(Event(Change.APPEARED, self._known[key]))
        for key in list(self._known):
            self._silent[key] = 0 if key in here else self._silent.get(key, 0) + 1
            if self._silent[key] >= PATIENCE:
                events.append(Event(Change.DISAPPEARED, self._known.pop(key)))
                del self._silent[key]
        sharing = clashes(self._known.values())
        for number in sorted(set(sharing) - self._clashing):
            text = f"number {number} is used by {' and by '.join(map(str, sharing[number]))}"
            events.append(Event(Change.CLASH, sharing[number][0], text))
        self._clashing = set(sharing)
        return events

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                for event in self.look():
                    self._tell(event)
                self._stop.wait(self._interval)
        except MachineError as error:
            LOG.error("nobody watches the modules any more: %s", error)
            self._tell(Event(Change.BUS_LOST, None, str(error)))

    def __enter__(self) -> Watch:
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
