"""What is asked of a gradebook's module, and what it answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import inf
from pathlib import Path

from rds.core.errors import InputError
from rds.grading.batch.finished import Finished


@dataclass(frozen=True)
class ExportOptions:
    """What the instructor says. None: nothing."""

    gradebook: Path | None = None  # the instructor's own, as it was downloaded
    column: str | None = None  # of the gradebook, or the assignment's name in it
    points: float | None = None  # that full marks become in the gradebook

    def refuse_all_but(self, used: tuple[str, ...], name: str) -> None:
        """InputError for an option that would be ignored."""
        for each in fields(self):
            if getattr(self, each.name) is not None and each.name not in used:
                raise InputError(f"--{each.name} has no meaning for {name}; leave it out")


@dataclass(frozen=True)
class Exported:
    """Files by name, and for whom there was no place: student and why. `notes` are for the instructor."""

    files: Mapping[str, bytes]
    unmatched: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    students: int = 0  # whose grades are in it


def scale(finished: Finished, points: float | None) -> float:
    """What every score is multiplied by. InputError for points that would make every score 0, or no number."""
    if points is None:
        return 1.0
    if not 0.0 < points < inf:
        raise InputError(f"--points {points:g} must be a finite number above 0: what full marks are to be")
    if finished.max_score <= 0.0:
        raise InputError("--points cannot be used: the assignment has no points")
    return points / finished.max_score


def scaled(score: float, factor: float) -> str:
    """A score as text, without the last digits' rounding."""
    return f"{score * factor:.9g}"
