"""What became of a batch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rds.grading.grade import Grade, Status


@dataclass(frozen=True)
class BatchOutcome:
    """All grades by student. `graded_now` and `seconds` are of this run of the program, `notes` for the instructor."""

    folder: Path
    grades: Mapping[str, Grade]
    graded_now: int
    seconds: float
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        counts = ", ".join(f"{many} {status.value}" for status, many in self.counts().items()) or "no submission"
        return f"<BatchOutcome: {counts}; in {self.folder}>"

    @property
    def submissions_per_second(self) -> float:
        """Graded in this run of the program; 0 if there was nothing left to do."""
        return self.graded_now / self.seconds if self.graded_now and self.seconds > 0.0 else 0.0

    @property
    def grader_errors(self) -> tuple[str, ...]:
        """Students who have no score, by our fault."""
        return tuple(name for name, grade in self.grades.items() if grade.status is Status.GRADER_ERROR)

    def counts(self) -> dict[Status, int]:
        """How many submissions have each status, where there are any."""
        counted = Counter(grade.status for grade in self.grades.values())
        return {status: counted[status] for status in Status if counted[status]}

    def to_json(self) -> dict[str, Any]:
        """What `--json` prints. Who could not be graded has no score: null, and no criteria."""
        return {
            "students": {name: _row(grade) for name, grade in self.grades.items()},
            "submissions_per_second": self.submissions_per_second,
        }


def _row(grade: Grade) -> dict[str, Any]:
    known = grade.status is not Status.GRADER_ERROR
    criteria = {
        each.name: {"score": each.score, "max_score": each.max_score, "value": each.value}
        for each in (grade.criteria if known else ())
    }
    return {
        "status": str(grade.status),
        "score": grade.score if known else None,
        "max_score": grade.max_score,
        "criteria": criteria,
    }
