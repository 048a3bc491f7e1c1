"""How long a pass over a run may take of the student's own time."""

from __future__ import annotations

import time
from types import TracebackType

from rds.core.thread_time import ThreadTime


class Allowance:
    """`seconds` for the thread that enters it, from then on; what others take of its time does not count.

    By the clock alone, a busy computer would leave samples out, and the fault that shows there with them.
    """

    def __init__(self, seconds: float):
        self.seconds = seconds

    def __enter__(self) -> Allowance:
        self._account = ThreadTime()
        self._account.begin()
        self._begun = time.perf_counter_ns()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._account.close()

    def is_spent(self) -> bool:
        """Whether the thread has had its time. The kernel is asked only when the clock alone says so."""
        span = time.perf_counter_ns() - self._begun
        most = 1e9 * self.seconds
        return span > most and span - self._account.taken(span) > most
