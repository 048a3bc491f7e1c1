"""Live values between host and target, such as a gain, the feed override or the wish to stop.

Shared memory of named float channels. The host sets values whenever it likes; the loop looks once at the beginning of
each sample, takes what has changed, and notes when it did: sample, channel, old value, new value. From these notes the
same run can be repeated. Nobody ever waits: a version that is odd while somebody writes tells the reader to look again
at the next sample, and writers take turns by a lock that the reader does not know of.
"""

from __future__ import annotations

import contextlib
import json
import mmap
import os
import struct
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from rds.core.errors import InputError
from rds.core.quantities import Quantity, near
from rds.modes.loop.shared_words import read_word, write_float, write_word
from rds.modes.process.shared import make

_MAGIC = b"RDSDESK1"
_VERSION, _NOTED, _SIZE, _TEXT = 8, 16, 24, 32
_NOTE = struct.Struct("<4d")  # sample, channel, old, new
NOTES = 4096  # changes kept until the recorder has copied them, every 0.05 s


@dataclass(frozen=True)
class Channel:
    """One live value: its name ("X.Pgain", "override"), what it means, its unit, its range and its first value."""

    name: str
    value: float
    meaning: str
    unit: str = ""
    low: float = -inf
    high: float = inf
    above: float = -inf  # a value must be more than this
    whole: bool = False

    @classmethod
    def of(cls, quantity: Quantity, name: str, value: float, unit: str = "mm") -> Channel:
        """The live value of a declared quantity. Where it says mm, `unit` is the axis's."""
        q = quantity
        meaning, of = q.meaning.replace("mm", unit), q.unit.replace("mm", unit)
        return cls(name, value, meaning, of, q.low, q.high, q.above, q.whole)

    def check(self, value: Any) -> float:
        """The value as a float; InputError with unit and range if it will not do."""
        declared = Quantity(self.meaning, self.unit, self.low, self.high, self.above, whole=self.whole)
        return float(declared.check(value, self.name))


class Note(NamedTuple):
    """A change as the loop took it: before which sample, of which channel, from what to what."""

    sample: int
    name: str
    old: float
    new: float


class LiveValues:
    """Channels in shared memory. `set` is the host's side; `news`, `take` and `note` are the loop's."""

    def __init__(self, memory: mmap.mmap, channels: Sequence[Channel], path: Path | None = None):
        self.channels = {channel.name: channel for channel in channels}
        self.path = path
        self._names = list(self.channels)
        self._memory = memory
        self._values = struct.Struct(f"<{len(self._names)}d")
        self._first_value = _TEXT + _text_size(read_word(memory, _SIZE))
        self._first_note = self._first_value + self._values.size
        self._seen = bytes(8)
        self._own = threading.Lock()
        self._verify: Any = None

    @classmethod
    def create(cls, path: str | Path | None, channels: Sequence[Channel]) -> LiveValues:
        """New ones in the file `path`, or (None) in the memory of this process alone. OSError if there is no room."""
        text = json.dumps([asdict(channel) for channel in channels]).encode()
        values = struct.Struct(f"<{len(channels)}d")
        first = _TEXT + _text_size(len(text))
        size = first + values.size + NOTES * _NOTE.size
        if path is None:
            memory = mmap.mmap(-1, size)
        else:
            make(path, size)
            memory = _map(path)
        write_word(memory, _SIZE, len(text))
        memory[_TEXT : _TEXT + len(text)] = text
        values.pack_into(memory, first, *(channel.value for channel in channels))
        memory[: len(_MAGIC)] = _MAGIC
        return cls(memory, channels, None if path is None else Path(path))

    @classmethod
    def open(cls, path: str | Path) -> LiveValues:
        """The live values in an existing file."""
        memory = _map(path)
        if memory[: len(_MAGIC)] != _MAGIC:
            raise InputError("not a run's live values", str(path))
        size = read_word(memory, _SIZE)
        return cls(memory, [Channel(**entry) for entry in json.loads(memory[_TEXT : _TEXT + size])], Path(path))

    # --- the host's side ------------------------------------------------------------------------------------------

    def set(self, name: str, value: float) -> None:
        """Let the loop take `value` for the channel `name` at its next sample.

        InputError for a channel that is not there, and for a value out of its range.
        """
        self.set_all({name: value})

    def set_all(self, values: Mapping[str, float]) -> None:
        """Several channels, which the loop takes at the same sample; all of them or, on an InputError, none."""
        checked = {name: self.channel(name).check(value) for name, value in values.items()}
        if self._verify is not None:
            self._verify(dict(self.values()) | checked)
        with self._writing():
            for name, value in checked.items():
                write_float(self._memory, self._first_value + 8 * self._names.index(name), value)

    def verify_with(self, verify: Any) -> None:
        """Let `verify(values of all channels)` have its say before values are set; it raises InputError."""
        self._verify = verify

    def channel(self, name: str) -> Channel:
        """The channel called `name`; InputError lists the ones there are."""
        return find(self.channels, name)

    def __getitem__(self, name: str) -> float:
        """What the channel was set to last."""
        self.channel(name)
        return self.values()[name]

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    def values(self) -> dict[str, float]:
        """What all channels were set to last."""
        return dict(zip(self._names, self._values.unpack_from(self._memory, self._first_value), strict=True))

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        with self._own, _locked(self.path):
            # An odd number that a killed writer left behind is taken over.
            odd = read_word(self._memory, _VERSION) | 1
            write_word(self._memory, _VERSION, odd)
            try:
                yield
            finally:
                write_word(self._memory, _VERSION, odd + 1)

    # --- the loop's side ------------------------------------------------------------------------------------------

    def news(self) -> bool:
        """Whether somebody has set a value since the last `take`."""
        return self._memory[_VERSION : _VERSION + 8] != self._seen

    def take(self) -> tuple[float, ...]:
        """The values of all channels in order, for the loop; () while somebody is writing: the next sample has them."""
        before = self._memory[_VERSION : _VERSION + 8]
        if before[0] & 1:
            return ()
        values: tuple[float, ...] = self._values.unpack_from(self._memory, self._first_value)
        if self._memory[_VERSION : _VERSION + 8] != before:
            return ()
        self._seen = before
        return values

    def show(self, name: str, value: float) -> None:
        """Let everybody see a value that the loop has changed by itself; it is no news."""
        write_float(self._memory, self._first_value + 8 * self._names.index(name), value)

    def note(self, note: Note) -> None:
        """The loop has taken a change."""
        count = read_word(self._memory, _NOTED)
        place = self._first_note + count % NOTES * _NOTE.size
        _NOTE.pack_into(self._memory, place, note.sample, self._names.index(note.name), note.old, note.new)
        write_word(self._memory, _NOTED, count + 1)

    def notes(self, first: int = 0) -> tuple[int, list[Note]]:
        """The notes from number `first` on, and the number of the first one that is still there."""
        count = read_word(self._memory, _NOTED)
        first = max(first, count - NOTES, 0)
        found = []
        for i in range(first, count):
            sample, index, old, new = _NOTE.unpack_from(self._memory, self._first_note + i % NOTES * _NOTE.size)
            found.append(Note(int(sample), self._names[int(index)], old, new))
        lost = max(read_word(self._memory, _NOTED) - NOTES - first, 0)  # overwritten while being copied
        return first + lost, found[lost:]

    def close(self) -> None:
        """Unmap; the file stays."""
        self._memory.close()


def find(channels: Mapping[str, Channel], name: str) -> Channel:
    """The channel called `name`; InputError lists the ones there are."""
    if name not in channels:
        has = f"{', '.join(channels)}{near(name, list(channels))}"
        raise InputError(f"there is no live value {name!r}; this run has {has}")
    return channels[name]


def _text_size(length: int) -> int:
    """Bytes for a text of `length`, so that the numbers behind it lie on whole words."""
    return -(-length // 8) * 8


def _map(path: str | Path) -> mmap.mmap:
    with open(path, "r+b") as file:
        return mmap.mmap(file.fileno(), 0)


@contextlib.contextmanager
def _locked(path: Path | None) -> Iterator[None]:
    """Writers of several processes take turns, where the system has locks on files."""
    try:
        import fcntl
    except ImportError:
        path = None
    if path is None:
        yield
        return
    descriptor = os.open(path, os.O_RDWR)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
