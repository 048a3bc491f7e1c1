"""Recording a bus into a log: nothing lost in silence, and what was recorded survives a kill.

python-can's logger records the built-in bus as well; this one counts the frames that it loses, names a bus that ends,
and flushes twice a second.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import can

from rds.bus.tools.logs import LogWriter, ending
from rds.bus.tools.receiver import Fault, ReceiveFault, Receiver
from rds.bus.tools.selection import Selection

FLUSH = 0.5  # s between flushes
_QUEUE = 262144  # frames that may wait for the disk: 14 s of the busiest bus of 1 Mbit/s
_LOOK = 0.1  # s


@dataclass
class Recording:
    """How a recording went."""

    path: str
    frames: int = 0  # in the file
    lost: int = 0  # because the disk was too slow
    unkept: dict[str, int] = field(default_factory=dict)  # frames that the format cannot hold, by kind
    seconds: float = 0.0
    faults: list[str] = field(default_factory=list)  # of the bus

    @property
    def complete(self) -> bool:
        """Whether everything that came over the bus is in the file."""
        return not (self.lost or self.unkept or self.faults)


def record(
    path: Path,
    open_bus: Callable[[], can.BusABC],
    *,
    name: str = "bus",
    seconds: float | None = None,
    count: int | None = None,
    selection: Selection | None = None,
    force: bool = False,
    stop: threading.Event | None = None,
    progress: Callable[[Recording], Any] | None = None,
    ready: Callable[[], Any] | None = None,
) -> Recording:
    """Record what comes over the bus until `stop` is set, `seconds` have passed, or `count` frames are in the file.

    A bus that fails is reported, in the log and in the result, and opened again. `progress` is called about ten times
    a second. Raises InputError for a file that exists (without `force`) or an unknown format, OSError when the disk
    fails, and whatever `open_bus` raises at the start; a file is made only when the bus is open.
    """
    ending(path)
    selection = selection or Selection()
    stop = stop or threading.Event()
    result = Recording(str(path))

    def note(fault: Fault) -> None:
        if fault.trouble is not ReceiveFault.OVERFLOW:  # those are counted
            result.faults.append(fault.text)

    receiver = Receiver(open_bus, note, name=name)
    queue = receiver.subscribe(name=f"the recording to {path.name}", limit=_QUEUE)
    with receiver, _named(path):
        log = LogWriter(path, force)
        try:
            began = flushed = looked = time.monotonic()
            if ready is not None:
                ready()
            while not (queue.ended or log.frames == count):
                if stop.is_set() or (seconds is not None and time.monotonic() - began >= seconds):
                    receiver.stop()  # what it has received so far is still written
                message = queue.get(_LOOK)
                if message is not None and message in selection:
                    log.write(message)
                now = time.monotonic()
                if now - flushed >= FLUSH:
                    flushed = now
                    log.flush()
                if now - looked >= _LOOK:
                    looked = now
                    result.frames, result.lost, result.seconds = log.frames, queue.lost, now - began
                    if progress is not None:
                        progress(result)
        finally:
            log.close()
            result.frames, result.lost, result.unkept = log.frames, queue.lost, dict(log.unkept)
            result.seconds = time.monotonic() - began
    return result


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Errors of the disk with the name of the log, which writing to an open file does not give."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), error.filename or str(path)) from error
