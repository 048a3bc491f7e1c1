"""Work that is done again whenever something changes: only the latest counts, and never two go on at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from rds.panels.session.task import Task

T = TypeVar("T")


class Latest(Generic[T]):
    """`begin()` starts the work, beside the page; `again()` says that its answer does not hold any more.

    Somebody calls `tick()` ten times a second.
    """

    def __init__(self, begin: Callable[[], Task[T]]):
        self._begin = begin
        self._task: Task[T] | None = None
        self._again = True

    @property
    def going_on(self) -> bool:
        """Whether an answer is still to come."""
        return self._again or self._task is not None

    def again(self) -> None:
        """What goes on is stopped, and begun again at the next tick."""
        self._again = True
        if self._task is not None and not self._task.done:
            self._task.stop()

    def tick(self) -> Task[T] | None:
        """The task whose answer, or error, holds now: once, when it is over."""
        task, found = self._task, None
        if task is not None and task.done:
            self._task = None
            found = None if self._again or task.stopped else task
        if self._task is None and self._again:
            self._again = False
            self._task = self._begin()
        return found
