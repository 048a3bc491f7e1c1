"""Replaying a log onto a bus, at the times at which its frames were recorded.

python-can's player sends whatever the log holds; this one refuses frames that would move a machine that is on the bus,
and says how late it was.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import can

from rds.bus.modules.rds import frames
from rds.bus.tools.link import bus_failed
from rds.bus.tools.live_machine import acts_on_machine, heard_now, live_modules, refusal
from rds.bus.tools.selection import Selection
from rds.core.errors import InputError

_LOOK = 0.1  # s after which a waiting replay looks whether it shall stop
_EXACT = 1e-6  # s, to which times in a log are exact
_PATIENCE = 5.0  # s for the bus to take a frame


@dataclass
class Replay:
    """How a replay went."""

    sent: int = 0
    skipped: dict[str, int] = field(default_factory=dict)  # frames that were left out, by reason
    channels: list[str] = field(default_factory=list)  # of the recorder, whose frames went onto this one bus
    seconds: float = 0.0
    latest: float = 0.0  # s, by how much a frame was sent too late, at most
    loops: int = 0
    stopped: bool = False  # before the end


def replay(
    log: Iterable[can.Message],
    bus: can.BusABC,
    *,
    speed: float = 1.0,
    begin: float = 0.0,
    end: float | None = None,
    selection: Selection | None = None,
    loops: int = 1,
    with_commands: bool = False,
    stop: threading.Event | None = None,
    progress: Callable[[Replay], Any] | None = None,
) -> Replay:
    """Send the frames of `log` (iterated once to look at it, and once a loop) with their distances in time / `speed`.

    Each frame has an absolute due time, so that lateness never adds up; one that is late goes at once. `begin` and
    `end` are in s of the log's own time after its first frame. `speed` may be infinite. Error frames can't be sent and
    are left out, counted. A loop follows the one before at the log's mean distance of frames.

    Raises InputError for a value that makes no sense, a log without frames to send, a damaged one, a frame that this
    bus can't carry, and unless `with_commands` for frames that are not harmless (live_machine.py) where a machine
    lives on the bus, or comes to it meanwhile. After commands zero volts are sent at the end. MachineError if the bus
    fails.
    """
    if not speed > 0.0:
        raise InputError(f"speed {speed!r} must be more than 0: 1 is the recorded speed, inf as fast as possible")
    if loops < 1:
        raise InputError(f"loop {loops!r} must be at least 1")
    if not 0.0 <= begin < (float("inf") if end is None else end):
        raise InputError(f"from {begin!r} s to {end!r} s is no span of a log; from must be before to, and at least 0")
    part = _Part(log, begin, end, selection or Selection())
    if not part.frames:
        raise InputError(
            f"there is no frame to send in this log ({part.seen} frames in all); look at --from, --to, --id"
        )
    if part.acts is not None and not with_commands:
        modules = live_modules(bus)
        if modules:
            raise refusal(part.acts, part.acting - 1, modules)
    result = Replay(skipped=part.skipped, channels=sorted(part.channels))
    try:
        _send_all(part, bus, result, speed, loops, stop or threading.Event(), progress, with_commands)
    finally:
        if part.commands:
            rest = can.Message(arbitration_id=frames.COMMAND, is_extended_id=False, data=frames.encode_voltages(()))
            _send(bus, rest)
    return result


class _Part:
    """What is to be sent of a log."""

    def __init__(self, log: Iterable[can.Message], begin: float, end: float | None, selection: Selection):
        self._log, self._begin, self._end, self._selection = log, begin, end, selection
        self.frames = self.seen = 0
        self.skipped: dict[str, int] = {}
        self.acts: can.Message | None = None  # the first frame that acts on a machine
        self.acting = 0  # how many do
        self.commands = False
        self.channels: set[str] = set()
        self.first = self.last = 0.0  # s in the log
        for at, message in self:
            self.first = at if not self.frames else self.first
            self.last = max(self.last, at)
            self.frames += 1
            if message.channel is not None:
                self.channels.add(str(message.channel))
            if acts_on_machine(message) is not None:
                self.acts = self.acts or message
                self.acting += 1
                plain = not (message.is_extended_id or message.is_remote_frame)
                self.commands |= plain and message.arbitration_id == frames.COMMAND
        left_out = self.seen - self.frames - sum(self.skipped.values())
        if left_out:
            self.skipped["not selected"] = left_out

    def __iter__(self) -> Iterator[tuple[float, can.Message]]:
        """Seconds after the log's first frame, never less than before, and the frame."""
        origin: float | None = None
        at = 0.0
        self.seen = errors = 0
        for message in self._log:
            origin = message.timestamp if origin is None else origin
            at = max(at, message.timestamp - origin)
            self.seen += 1
            if at < self._begin - _EXACT or (self._end is not None and at > self._end + _EXACT):
                continue
            if message not in self._selection:
                continue
            if message.is_error_frame:
                errors += 1
                self.skipped["error frames"] = errors
                continue
            yield at, message

    @property
    def duration(self) -> float:
        """From the first frame of one loop to the first of the next, s."""
        length = self.last - self.first
        return length + (length / (self.frames - 1) if self.frames > 1 else 0.0)


def _send_all(
    part: _Part,
    bus: can.BusABC,
    result: Replay,
    speed: float,
    loops: int,
    stop: threading.Event,
    progress: Callable[[Replay], Any] | None,
    with_commands: bool,
) -> None:
    began = looked = time.monotonic()
    for loop in range(loops):
        start = began + loop * part.duration / speed
        for at, message in part:
            due = start + (at - part.first) / speed
            now = _wait(due, stop, lambda: _listen(part, bus, with_commands))
            if stop.is_set():
                result.stopped = True
                return
            _send(bus, message)
            result.sent += 1
            result.latest = max(result.latest, now - due)
            result.seconds = now - began
            if now - looked >= _LOOK:
                looked = now
                _listen(part, bus, with_commands)
                if progress is not None:
                    progress(result)
        result.loops += 1


def _listen(part: _Part, bus: can.BusABC, with_commands: bool) -> None:
    """Take what others send, so that nobody waits for it to be read; refuse to go on where a machine has come."""
    try:
        modules = heard_now(bus)
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error
    if modules and part.acts is not None and not with_commands:
        raise refusal(part.acts, part.acting - 1, modules)


def _wait(due: float, stop: threading.Event, look: Callable[[], None]) -> float:
    """Wait until the due time or the stop, and `look` every now and then; return the time."""
    while (left := due - (now := time.monotonic())) > 0.0:
        if left > _LOOK:
            look()
            stop.wait(_LOOK)
            if stop.is_set():
                return time.monotonic()
        else:
            time.sleep(left)
    return now


def _send(bus: can.BusABC, message: can.Message) -> None:
    try:
        bus.send(message, _PATIENCE)
    except (can.CanError, OSError) as error:
        raise bus_failed(bus.channel_info, error) from error
    except ValueError as error:
        raise InputError(f"this bus can't carry a frame of the log: {error}") from error
