"""Long work beside the page: it says how far it is, can be stopped, and keeps its result or its error."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Generic, TypeVar

from rds.core.blame import is_students, student_error
from rds.core.errors import ContractError
from rds.core.interrupt import Endless, interruptible

T = TypeVar("T")


class Stopped(BaseException):
    """Raised inside a task's work once somebody has asked it to end. No Exception, which the work may catch."""

    def __init__(self) -> None:
        super().__init__("stopped")


class Task(Generic[T]):
    """One piece of work in a thread of its own: `work(task)` calls `task.advance(...)` now and then.

    `advance` raises Stopped once `stop()` was called; work that has a better way of ending hands in `on_stop`.
    `own_code` says that a user's code is called in it, which is interrupted where it is if it does not end.
    """

    def __init__(
        self,
        title: str,
        work: Callable[[Task[T]], T],
        on_stop: Callable[[], None] | None = None,
        own_code: bool = False,
    ):
        self.title = title
        self.result: T | None = None
        self.error: BaseException | None = None
        self.note = ""  # what it is doing now
        self._work, self._on_stop, self._own_code = work, on_stop, own_code
        self._share: float | None = None
        self._began: float | None = None
        self._ended: float | None = None
        self._over = threading.Event()
        self._asked = threading.Event()
        self._thread = threading.Thread(target=self._go, name=f"rds {title}", daemon=True)

    def start(self) -> Task[T]:
        """Begin."""
        self._began = time.monotonic()
        self._thread.start()
        return self

    def pulse(self) -> None:
        """Said by work that cannot tell how far it is. Raises Stopped when it should end."""
        self.advance(0.0, 0.0)

    def advance(self, done: float, of: float, note: str = "") -> None:
        """Said by the work: how far it is. Raises Stopped when it should end."""
        self._share = min(max(done / of, 0.0), 1.0) if of > 0 else None
        if note:
            self.note = note
        if self._asked.is_set() and self._on_stop is None:
            raise Stopped

    def stop(self) -> None:
        """Ask it to end."""
        self._asked.set()
        if self._on_stop is not None and not self.done:
            self._on_stop()

    @property
    def stopping(self) -> bool:
        """Whether it was asked to end."""
        return self._asked.is_set()

    @property
    def share(self) -> float | None:
        """How much is done, 0 to 1; None where that is not known."""
        return 1.0 if self.done and self.error is None else self._share

    @property
    def seconds(self) -> float:
        """How long it has taken so far, or took."""
        if self._began is None:
            return 0.0
        return (self._ended or time.monotonic()) - self._began

    @property
    def seconds_left(self) -> float | None:
        """How long it will still take, by its pace so far."""
        share = self._share
        return None if not share or self.done else self.seconds * (1.0 - share) / share

    @property
    def done(self) -> bool:
        """Whether it is over, well or not."""
        return self._over.is_set()

    @property
    def stopped(self) -> bool:
        """Whether it ended because it was asked to."""
        return isinstance(self.error, Stopped)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for its end; false after `timeout` s."""
        return self._over.wait(timeout)

    def _go(self) -> None:
        try:
            if self._own_code:
                self.result = interruptible(lambda: self._work(self), self._asked.is_set)
            else:
                self.result = self._work(self)
        except Endless as error:
            self.error = ContractError(student_error(error)) if is_students(error) else Stopped()
        except BaseException as error:
            self.error = error
        finally:
            self._ended = time.monotonic()
            self._over.set()
