"""How long this thread was kept from running, by the kernel's own accounts of it.

A thread that is off the processor either waits by its own doing (it sleeps, it waits for a file or a lock) or was taken
off: something else ran, the process was stopped, real-time throttling held it, a page had to come from the disk, or the
hypervisor ran another machine. The kernel counts each time that a thread gives up the processor of its own accord; time
off the processor without that is never the thread's own doing.
"""

from __future__ import annotations

import contextlib
import os
import time

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

_COUNTS = hasattr(resource, "RUSAGE_THREAD")  # on Linux


class ThreadTime:
    """The accounts of the thread that made it. Where the kernel keeps none, nothing is ever taken."""

    def __init__(self) -> None:
        self._schedstat = -1
        with contextlib.suppress(OSError):
            self._schedstat = os.open("/proc/thread-self/schedstat", os.O_RDONLY)
        self.stops = 0  # times that the process was stopped and went on
        self.page_faults = 0  # between `begin` and `taken`, that had to wait for a disk
        self._begun = (0, 0, 0, 0, 0)

    def waited(self) -> int:
        """Nanoseconds so far in which this thread was ready to run but not run (0 where the kernel doesn't tell)."""
        if self._schedstat < 0:
            return 0
        return int(os.pread(self._schedstat, 64, 0).split()[1])

    def went_on(self, *_: object) -> None:
        """The handler of SIGCONT."""
        self.stops += 1

    def begin(self) -> None:
        """From here on the thread does what is to be accounted for."""
        self._begun = self._now()

    def taken(self, span: int) -> int:
        """Of the `span` (ns) since `begin`: for how long the thread did not run, and not by its own doing."""
        waited, processor, gave_up, faults, stops = (
            now - begun for now, begun in zip(self._now(), self._begun, strict=True)
        )
        self.page_faults += faults
        if not _COUNTS or (gave_up and not faults and not stops):
            return waited
        return max(waited, span - processor)

    def close(self) -> None:
        """Let go of the kernel's accounts."""
        if self._schedstat >= 0:
            os.close(self._schedstat)
            self._schedstat = -1

    def _now(self) -> tuple[int, int, int, int, int]:
        """Waited and run (ns), times that the processor was given up, pages from the disk, stops."""
        if not _COUNTS:
            return self.waited(), 0, 0, 0, self.stops
        usage = resource.getrusage(resource.RUSAGE_THREAD)
        return self.waited(), time.thread_time_ns(), usage.ru_nvcsw, usage.ru_majflt, self.stops
