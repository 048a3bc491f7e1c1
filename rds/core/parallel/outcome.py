"""What became of one item."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Failure(StrEnum):
    """Why an item has no value."""

    RAISED = "raised"  # the function raised an exception
    DIED = "died"  # its worker process ended, each time it was tried
    OVERDUE = "overdue"  # it took longer than the time limit, each time it was tried


@dataclass(frozen=True)
class Outcome:
    """The value that the function returned for item number `index`, or why there is none."""

    index: int
    value: Any = None
    failure: Failure | None = None
    reason: str = ""  # of the failure, a sentence
    attempts: int = 1

    @property
    def ok(self) -> bool:
        """Whether there is a value."""
        return self.failure is None


def reason_of(error: BaseException) -> str:
    """An exception as a sentence: our own as they are, others with their kind."""
    from rds.core.errors import RdsError

    return str(error) if isinstance(error, RdsError) else f"{type(error).__name__}: {error}"
