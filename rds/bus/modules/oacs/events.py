"""Reconfigurations as they happen: modules removed and added, and when the machine can be used again.

`rds report reconfiguration` reads these events. They are

    present    a module that was there when the watch began
    removed    a module that answers no more
    added      a module that answers, and did not before
    clash      two modules share a number
    offered    after a change: the modules that are there make a machine (offers.py)
    refused    after a change: they make none
    moving     an axis of the machine that was accepted moves
    ready      after a change: as many modules are there as should be, no two share a number, and each has been asked
               for its data and has given them whole; where machines are offered, one has been accepted

Times are those at which the change was noticed, a second after it at most (watch.py).
"""

from __future__ import annotations

import csv
import time
from pathlib import Path
from typing import NamedTuple

import can

from rds.bus.modules.oacs.host import ModuleInfo
from rds.bus.modules.oacs.remote import Module
from rds.bus.modules.oacs.watch import Change, Watch
from rds.core.errors import InputError, MachineError
from rds.core.private_files import open_private

COLUMNS = ("time_s", "event", "module")
_PATIENCE = 0.5  # s for a download
_WORDS = {Change.APPEARED: "added", Change.DISAPPEARED: "removed", Change.CLASH: "clash"}


class ModuleEvent(NamedTuple):
    """An event; `module` is "" where it is of no single one."""

    time: float  # s since the watch began
    event: str
    module: str


class Reconfigurations:
    """Watches the modules on an open `bus`, which nobody else may read meanwhile.

    `modules` is how many there should be; without it, as many as at the first look, one at least.
    """

    def __init__(self, bus: can.BusABC, modules: int | None = None):
        if modules is not None and modules < 1:
            raise InputError(f"modules = {modules!r} must be at least 1")
        self._bus = bus
        self._watch = Watch(bus)
        self._expected = modules
        self._began: float | None = None
        self._changed = False
        self._described: set[tuple[int, int | None]] = set()  # modules that have given their data

    def go_on(self, bus: can.BusABC) -> None:
        """Look on this open bus from now on."""
        self._bus = bus
        self._watch.go_on(bus)

    @property
    def expected(self) -> int:
        """How many modules there should be; 1 before the first look, if nobody said."""
        return self._expected or 1

    @property
    def now(self) -> float:
        """s since the first look; 0 before it."""
        return 0.0 if self._began is None else time.monotonic() - self._began

    @property
    def numbers(self) -> list[int]:
        """Of the modules that are there."""
        return sorted(module.id for module in self._watch.modules)

    def look(self) -> list[ModuleEvent]:
        """What has happened since the last look. MachineError if the bus fails."""
        first = self._began is None
        if self._began is None:
            self._began = time.monotonic()
        changes = self._watch.look()
        now = time.monotonic() - self._began
        happened = []
        for change, module, _ in changes:
            if module is None:
                continue
            word = "present" if first and change is Change.APPEARED else _WORDS[change]
            happened.append(ModuleEvent(now, word, _name(module)))
            self._changed |= word in ("added", "removed")
        if first and self._expected is None:
            self._expected = max(1, len(self._watch.modules))
        if self._changed and self._is_ready():
            self._changed = False
            happened.append(ModuleEvent(time.monotonic() - self._began, "ready", ""))
        return happened

    def _is_ready(self) -> bool:
        here = self._watch.modules
        keys = {(module.id, module.serial) for module in here}
        self._described &= keys
        if len(here) < self.expected or len({module.id for module in here}) < len(here):
            return False
        for number, serial in sorted(keys - self._described):
            try:
                told = Module(self._bus, number).download(_PATIENCE)
            except MachineError:
                return False  # asked again at the next look
            if serial in (None, told.serial):
                self._described.add((number, serial))
        return keys <= self._described


class EventFile:
    """A CSV file of events, each in the file as soon as it has happened. An existing file is not overwritten."""

    def __init__(self, path: Path, force: bool = False):
        try:
            self._file = open_private(path, "w" if force else "x", encoding="utf-8", newline="")
        except FileExistsError as error:
            raise InputError("the file exists; choose another name, or give --force", str(path)) from error
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._put(COLUMNS)

    def add(self, happened: ModuleEvent) -> None:
        """Write it."""
        self._put((f"{happened.time:.3f}", happened.event, happened.module))

    def _put(self, row: tuple[str, ...]) -> None:
        self._writer.writerow(row)
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _name(module: ModuleInfo) -> str:
    return f"{module.type or module.kind or 'module'} {module.id}"
