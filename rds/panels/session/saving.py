"""A run whose results are not saved yet although its loop is over: its folder is held by whoever saves them."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from rds.core.private_files import make_folder, open_descriptor

try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # Windows: a run that is being saved looks as if it had been cut short
    flock = None  # type: ignore[assignment]

NAME = ".saving.lock"


@contextlib.contextmanager
def saving(folder: Path) -> Iterator[None]:
    """Hold `folder` (made if it is not there) until its results are saved, or until this process ends, however.

    A folder that cannot be written to is not held: whoever saves into it says so.
    """
    descriptor = -1
    with contextlib.suppress(OSError):
        make_folder(folder)
        descriptor = open_descriptor(folder / NAME, os.O_RDWR | os.O_CREAT, is_own=True)
        if flock is not None:
            flock(descriptor, LOCK_EX)
    try:
        yield
    finally:
        if descriptor >= 0:
            os.close(descriptor)
        with contextlib.suppress(OSError):
            (folder / NAME).unlink(missing_ok=True)
            folder.rmdir()  # of a run that left nothing


def is_being_saved(folder: Path) -> bool:
    """Whether some process holds `folder`."""
    if flock is None:
        return False
    try:
        descriptor = os.open(folder / NAME, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        flock(descriptor, LOCK_EX | LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
