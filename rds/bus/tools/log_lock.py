"""One writer per log: two that write the same file would destroy it, and each would report a whole log."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from rds.core.errors import InputError

try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # Windows refuses by itself to remove what is open, and locks would keep readers out
    flock = None  # type: ignore[assignment]


def hold(path: Path) -> int | None:
    """A descriptor that marks the file as being written until it is closed, also by the end of the process.

    None where there is nothing to mark: no such file, no regular one, or a file system without locks. Raises
    InputError if another writer, of this process or another, holds it.
    """
    if flock is None:
        return None
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # a FIFO must not make this wait
    except OSError:
        return None
    try:
        if stat.S_ISREG(os.fstat(descriptor).st_mode):
            flock(descriptor, LOCK_EX | LOCK_NB)
            return descriptor
    except BlockingIOError:
        os.close(descriptor)
        raise InputError("another recording is writing it; choose another name, or end that one", str(path)) from None
    except OSError:  # no locks there
        pass
    os.close(descriptor)
    return None


def release(descriptor: int | None) -> None:
    """Let go of what hold() returned."""
    if descriptor is not None:
        os.close(descriptor)
