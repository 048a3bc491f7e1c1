"""Folders for a while in the system's temporary one. What a killed grader left there, the next one removes.

Each is locked by the process that made it, and the kernel gives the lock back when that ends, however it ends: a folder
whose lock is free is nobody's any more.
"""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_PREFIX = "rds-grading-"


@contextmanager
def scratch(word: str) -> Iterator[Path]:
    """An empty folder of this process's own, named by `word`; gone afterwards, at the latest by the next call."""
    _sweep()
    folder, lock = _made(word)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def _made(word: str) -> tuple[Path, int]:
    while True:
        folder = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{word}-"))
        lock = -1
        with suppress(FileNotFoundError):  # another process found it without its lock, and swept it away
            lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
            fcntl.flock(lock, fcntl.LOCK_EX)
            if os.fstat(lock).st_ino == folder.stat().st_ino:
                return folder, lock
        if lock >= 0:
            os.close(lock)


def _sweep() -> None:
    """Remove this user's folders whose process has ended. What cannot be removed stays: that is no grade's concern."""
    with suppress(OSError), os.scandir(tempfile.gettempdir()) as entries:
        for path in [entry.path for entry in entries if entry.name.startswith(_PREFIX)]:
            with suppress(OSError):
                _remove_if_left(path)


def _remove_if_left(path: str) -> None:
    lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        if os.fstat(lock).st_uid == os.geteuid():
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(path)
    finally:
        os.close(lock)
