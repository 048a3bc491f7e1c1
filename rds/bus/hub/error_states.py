"""The error state of every node of a channel with bit timing, in a file that all can read at no cost.

So send() knows that its node is bus off without asking the hub. One byte for each seat; a node's seat is its number
modulo `SEATS`. The hub writes, nodes read.
"""

from __future__ import annotations

import contextlib
import errno
import mmap
import os
from pathlib import Path

SEATS = 1 << 16


class ErrorStateFile:
    """The hub's end: makes the file at `path`, and removes it. OSError if there is no room for it."""

    def __init__(self, path: Path):
        self._path = path
        with contextlib.suppress(PermissionError):  # Windows keeps files that are open
            path.unlink(missing_ok=True)  # who still looks at an old one keeps it
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            os.truncate(descriptor, 0)
            # written, not only said to be so long: where the disk has no room, a later write would kill the hub
            if os.write(descriptor, bytes(SEATS)) < SEATS:
                path.unlink()
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
            self._states = mmap.mmap(descriptor, SEATS)
        finally:
            os.close(descriptor)

    def show(self, number: int, state: int) -> None:
        """The state of the node with this number."""
        self._states[number % SEATS] = state

    def remove(self) -> None:
        """Take it away."""
        self._states.close()
        with contextlib.suppress(PermissionError):
            self._path.unlink(missing_ok=True)


class ErrorStateReader:
    """A node's end: its own state in the file at `path`. OSError if there is none."""

    def __init__(self, path: Path, number: int):
        with open(path, "rb") as file:
            self._states = mmap.mmap(file.fileno(), SEATS, access=mmap.ACCESS_READ)
        self._seat = number % SEATS

    def state(self) -> int:
        """The state now, as in confinement.ErrorState."""
        return self._states[self._seat]

    def close(self) -> None:
        """Look no more; the last state stays readable by nobody."""
        self._states.close()
