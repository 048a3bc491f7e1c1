"""Changes of live values: planned before a run, taken at the beginning of a sample, kept with the result."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from math import ceil
from pathlib import Path
from time import sleep
from typing import Any, NamedTuple

from rds.core.errors import InputError
from rds.core.quantities import Quantity
from rds.core.shared_quantities import DURATION
from rds.core.types import Ending
from rds.modes.loop.live_values import Channel, LiveValues, Note, find

FILE = "changes.csv"
STOP = "stop"
_LOOK = 0.005  # s between two looks at the live values while time stands still
_TIME = Quantity("", "s", 0.0, DURATION.high)
_HEADINGS = ("time [s]", "name", "old", "new")


class Change(NamedTuple):
    """A live value that was changed while a run went on: when (s), which, from what to what."""

    time: float
    name: str
    old: float
    new: float


def stop_channel() -> Channel:
    """The channel by which every run is ended before its time."""
    return Channel(STOP, 0.0, "1 ends the run before its next sample", low=0.0, high=1.0, whole=True)


class LiveChanges:
    """Takes the changes that are due: called with the number of each sample before it is taken.

    `actions` say what a new value does, by channel ("stop" ends the run unless they say otherwise); `planned` are
    changes known before the run, as (sample, channel, value) in order. Set `live_values` to take those of
    somebody who changes values while it runs. `over()` is asked at each sample whether what drives the axes is at its
    end, and why. `in_virtual_time`, time stands still for as long as `waits()` says that only an operator can
    go on.
    """

    def __init__(
        self,
        channels: Sequence[Channel],
        actions: Mapping[str, Callable[[float], None]],
        planned: Sequence[tuple[int, str, float]] = (),
        over: Callable[[], tuple[Ending, str] | None] | None = None,
        waits: Callable[[], bool] | None = None,
    ):
        self.values = {channel.name: channel.value for channel in channels}
        self.taken: list[Note] = []
        self.live_values: LiveValues | None = None
        self.in_virtual_time = False
        self.reason = ""  # why the run ended early, in a sentence
        self._names = list(self.values)
        self._actions = {STOP: self._stop} | dict(actions)
        self._planned = list(planned)
        self._next = 0  # of the planned changes
        self._ending: Ending | None = None
        self._over, self._waits = over, waits

    def __call__(self, k: int) -> Ending | None:
        """Take what has changed before sample `k`; how the run ends here, if it does."""
        if self._waits is not None and self.in_virtual_time and self.live_values is not None:
            while self._waits() and not self.live_values.news():
                sleep(_LOOK)
        planned = self._planned
        live_values = self.live_values
        while self._next < len(planned) and planned[self._next][0] <= k:
            _, name, value = planned[self._next]
            self._next += 1
            self._apply(k, name, value)
            if live_values is not None:
                live_values.show(name, value)
        if live_values is not None and live_values.news():
            values = self.values
            for name, value in zip(self._names, live_values.take(), strict=False):
                if value != values[name]:
                    self._apply(k, name, value)
        return self._ending if self._ending is not None else self.at_end()

    def at_end(self) -> Ending | None:
        """How what drives the axes ends the run, if it does: asked after the last sample, too."""
        if self._over is None or (over := self._over()) is None:
            return None
        ending, self.reason = over
        return ending

    @property
    def is_idle(self) -> bool:
        """Whether nobody can have a say: then the loop need not ask."""
        return self.live_values is None and not self._planned and self._over is None

    def expects(self, names: Container[str]) -> bool:
        """Whether one of these live values can still change: an operator may act, or a change of it is planned."""
        return self.live_values is not None or any(change[1] in names for change in self._planned[self._next :])

    def _stop(self, value: float) -> None:
        self._ending = Ending.STOPPED if value else None

    def _apply(self, k: int, name: str, value: float) -> None:
        old = self.values[name]
        self.values[name] = value
        note = Note(k, name, old, value)
        self.taken.append(note)
        if self.live_values is not None:
            self.live_values.note(note)
        self._actions[name](value)


def plan_changes(
    changes: Iterable[Any], channels: Mapping[str, Channel], T: float
) -> tuple[tuple[int, str, float], ...]:
    """Changes as the loop takes them: (sample, channel, value), in order of time.

    Each of `changes` is (time in s, channel, value), a `Change`, or a row of `meta["changes"]`. A change between two
    samples is taken by the later one. InputError for what is not so, or is out of a channel's range.
    """
    planned = []
    for entry in changes:
        if not isinstance(entry, Sequence) or isinstance(entry, str) or len(entry) not in (3, 4):
            raise InputError(f'change {entry!r:.100} must be (time in s, name, value), as in (1.5, "X.Pgain", 20.0)')
        time, name, value = entry[0], entry[1], entry[-1]
        if (fault := _TIME.fault(time)) is not None:
            raise InputError(f"change {entry!r:.100}: its time {fault}")
        if not isinstance(name, str):
            raise InputError(f"change {entry!r:.100}: its second part must be the name of a live value")
        planned.append((_sample(float(time), T), name, find(channels, name).check(value)))
    return tuple(sorted(planned, key=lambda change: change[0]))


def _sample(time: float, T: float) -> int:
    """The first sample at or after a time; rounding does not push a sample's own time to the next."""
    nearest = round(time / T)
    return nearest if abs(time / T - nearest) < 1e-6 else ceil(time / T)


def timed(notes: Iterable[Note], T: float) -> list[Change]:
    """Changes with the time of the sample that took them."""
    return [Change(note.sample * T, note.name, note.old, note.new) for note in notes]


def as_text(changes: Iterable[Change], headings: bool = True) -> str:
    """Lines of a CSV file."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    if headings:
        writer.writerow(_HEADINGS)
    writer.writerows((repr(c.time), c.name, repr(c.old), repr(c.new)) for c in changes)
    return stream.getvalue()


def read_changes(directory: str | Path) -> list[Change]:
    """The changes kept in a run's `directory`; of a file that was cut short, those of its whole lines."""
    try:
        text = (Path(directory) / FILE).read_text()
    except (OSError, UnicodeDecodeError):
        return []
    rows = csv.reader(text[: text.rfind("\n") + 1].splitlines()[1:])
    return [Change(float(row[0]), row[1], float(row[2]), float(row[3])) for row in rows if len(row) == 4]
