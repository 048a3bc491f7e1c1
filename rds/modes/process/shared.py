"""Where the shared memory of runs lies: in memory where the system has a file system for that, for a disk that is busy
must not stop the loop. What a run left there whose processes were all killed, the next run removes.

Each process holds a lock on the ring that it has mapped, and the kernel gives it back when the process ends, however it
ends: a ring whose lock is free is nobody's any more.
"""

from __future__ import annotations

import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from rds.core.private_files import open_private

_YOUNG = 60.0  # s: a ring may just have been made, and its lock not yet taken


def folders() -> list[Path]:
    """Where the ring of a run may lie, with its live values beside it; the best first."""
    memory, disk = Path("/dev/shm"), Path(tempfile.gettempdir())
    return [memory, disk] if os.access(memory, os.W_OK) else [disk]


def make(path: str | Path, size: int) -> None:
    """A new file of `size` bytes that are really there, of zeros, which only its user can open or map.

    OSError where there is no room, and then it is no file; FileExistsError where there is one, which stays.

    Of one that is only said to be so long, the kernel would look for the room when a process writes, and kill the
    process if there is none.
    """
    try:
        with open_private(path, "xb", is_own=True) as new:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(new.fileno(), 0, size)
            else:
                new.truncate(size)
    except FileExistsError:
        raise
    except OSError:
        Path(path).unlink(missing_ok=True)
        raise


def hold(ring: IO[bytes]) -> None:
    """Until this open file is closed, or the process ends, the ring is somebody's."""
    with suppress(ImportError, OSError):  # Windows keeps a file that is mapped by itself
        import fcntl

        fcntl.flock(ring, fcntl.LOCK_SH)


def remove_left(folder: Path) -> None:
    """Remove this user's rings that nobody holds, with their live values. What cannot be removed stays."""
    try:
        import fcntl
    except ImportError:
        return
    for ring in folder.glob("rds-*.ring"):
        with suppress(OSError):
            lock = os.open(ring, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
            try:
                about = os.fstat(lock)
                if about.st_uid == os.geteuid() and time.time() - about.st_ctime > _YOUNG:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    ring.with_suffix(".live").unlink(missing_ok=True)
                    ring.unlink()
            finally:
                os.close(lock)
