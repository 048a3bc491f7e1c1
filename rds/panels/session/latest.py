"""Work that is done again whenever something changes: only the latest counts, and never two go on at once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

from rds.panels.session.task import Task

T = TypeVar("T")
Stamp = tuple[int, int]  # time of the last change, ns, and size, bytes


def stamp(file: Path | None) -> Stamp | None:
    """What tells a file from what it was; None where there is none."""
    try:
        found = file.stat() if file is not None else None
    except OSError:
        return None
    return found and (found.st_mtime_ns, found.st_size)


class Latest(Generic[T]):
    """`begin()` starts the work, beside the page; `again()` says that its answer does not hold any more.

    Neither does it when `file()`, of which it was made, has been written anew. Somebody calls `tick()` ten times a
    second.
    """

    def __init__(self, begin: Callable[[], Task[T]], file: Callable[[], Path | None] = lambda: None):
        self._begin, self._file = begin, file
        self._read: Stamp | None = None  # of the file, when the work was begun
        self._task: Task[T] | None = None
        self._again = True

    @property
    def going_on(self) -> bool:
        """Whether an answer is still to come."""
        return self._again or self._task is not None or stamp(self._file()) != self._read

    def again(self) -> None:
        """What goes on is stopped, and begun again at the next tick."""
        self._again = True
        if self._task is not None and not self._task.done:
            self._task.stop()

    def tick(self) -> Task[T] | None:
        """The task whose answer, or error, holds now: once, when it is over."""
        if stamp(self._file()) != self._read:
            self.again()
        task, found = self._task, None
        if task is not None and task.done:
            self._task = None
            found = None if self._again or task.stopped else task
        if self._task is None and self._again:
            self._again, self._read = False, stamp(self._file())
            self._task = self._begin()
        return found
