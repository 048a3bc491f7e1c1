"""Figures of a run's work that are the same each time, on a busy computer too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a file that its author tries without a sandbox is counted too, on systems that have none
    from rds.grading.sandbox.run import Run, Sample


@dataclass(frozen=True)
class WorkCounts:
    """Deterministic figures of one run's work: the same for the same input, on a busy computer too.

    `events` are lines, calls and returns of Python, and calls of compiled functions, in all `calls` together. They are
    None where they could not be counted; `refused` says why.
    """

    calls: int
    events: int | None = None
    refused: str = ""


def count_again(first: Sequence[Sample], again: Run) -> WorkCounts:
    """The questions of a run asked once more in the counted run `again`, which must give the same answers."""
    for asked, answered in first:
        if again.ask(*asked)[2:] != answered:
            t = (again.k - 1) * again.T
            return WorkCounts(len(first), refused=f"at t = {t:.3f} s it answered otherwise while it was counted")
    events = again.total()
    if events < 0:
        return WorkCounts(len(first), refused="it has tampered with the counter")
    return WorkCounts(len(first), events)
