"""Files read in a process of their own: where one sends a library in C round in circles, only that process is lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from rds.core.errors import InputError

Found = TypeVar("Found")

_PATIENCE = 60.0  # s
_SLOWEST = 2e6  # bytes of a file that are read in a second, on a busy computer


def read_apart(read: Callable[[Path], Found], path: Path) -> Found:
    """What `read(path)` returns, which must pickle; InputError for what it refuses, or where it ends or never does."""
    from rds.core.parallel import spread
    from rds.core.parallel.outcome import Failure

    limit = _PATIENCE + path.stat().st_size / _SLOWEST
    (outcome,) = spread(read, [path.resolve()], jobs=1, retries=0, time_limit=limit)
    if outcome.failure is Failure.RAISED:
        raise InputError(outcome.reason)
    if outcome.failure is not None:
        what = f"was not over after {limit:.0f} s" if outcome.failure is Failure.OVERDUE else "ended the process"
        raise InputError(f"to read it {what}: it is damaged, or was made to do harm; take another copy")
    found: Found = outcome.value
    return found
