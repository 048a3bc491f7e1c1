"""Files read in a process of their own: where one leads a library astray, or fills its memory, only that is lost."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from rds.core.errors import InputError
from rds.core.limits import lifted, most_unpacked, refusal

Found = TypeVar("Found")

_PATIENCE = 60.0  # s
_SLOWEST = 2e6  # bytes of a file that are read in a second, on a busy computer
_LIBRARIES = 1 << 30  # bytes of address space that numpy, scipy, pyarrow or asammdf take for themselves
_COPIES = 4  # of what is read, while it is converted and sent


def read_apart(read: Callable[[Path], Found], path: Path) -> Found:
    """What `read(path)` returns, which must pickle; InputError for what it refuses, or where it ends or never does.

    It has a minute and some time for each byte, and on Linux as much memory as the file may be unpacked to.
    """
    from rds.core.parallel import spread
    from rds.core.parallel.outcome import Failure

    packed = path.stat().st_size
    seconds = (_PATIENCE + packed / _SLOWEST) * lifted()
    memory = _LIBRARIES + _COPIES * int(most_unpacked(packed))
    confined = _Confined(read, memory)
    (outcome,) = spread(confined, [path.resolve()], jobs=1, retries=0, time_limit=seconds)
    if outcome.failure is Failure.RAISED:
        raise InputError(outcome.reason)
    if outcome.failure is not None:
        what = f"was not over after {seconds:.0f} s" if outcome.failure is Failure.OVERDUE else "ended the process"
        raise InputError(f"to read it {what}: it is damaged, or was made to do harm; take another copy")
    if isinstance(outcome.value, _NoMemory):
        what = f"to read its {packed} bytes takes more memory than it is given ({outcome.value.reason:.100})"
        raise refusal(what, memory / lifted(), "take another copy")
    found: Found = outcome.value
    return found


@dataclass(frozen=True)
class _NoMemory:
    """What a process answers that has no memory left."""

    reason: str


@dataclass(frozen=True)
class _Confined:
    """Reads with so many bytes of address space more than the process has at its start."""

    read: Callable[[Path], Any]
    memory: int

    def __call__(self, path: Path) -> Any:
        confine(self.memory)
        try:
            return self.read(path)
        except MemoryError as error:
            return _NoMemory(str(error) or "out of memory")


def confine(memory: int) -> None:
    """Give this process `memory` bytes of address space more than it has, on Linux: what is over raises MemoryError."""
    with contextlib.suppress(ImportError, OSError, ValueError):  # other systems; a lower limit that is set already
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (most, resource.getrlimit(resource.RLIMIT_AS)[1]))
