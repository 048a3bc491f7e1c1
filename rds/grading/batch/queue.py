"""From what was handed in to what is to be graded: files copied, notebooks converted, the rest with its reason."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rds.core.atomic import write_whole
from rds.core.parallel import spread
from rds.core.parallel.reader_process import confine
from rds.grading.assignment.assignment import Assignment
from rds.grading.assignment.late_rules import days_late
from rds.grading.batch.finished import CODE
from rds.grading.batch.spool import Spool, Spooled
from rds.grading.grade import Grade, Status
from rds.grading.intake import HandedIn, Intake
from rds.grading.intake.items import Refusal
from rds.grading.intake.names import safe_id
from rds.grading.intake.notebooks import Converted, converted
from rds.grading.intake.single import wanted
from rds.grading.intake.submissions import status_of

MEMORY = 2 << 30  # bytes for a file that is parsed
_PATIENCE = 30.0  # s for a notebook


@dataclass(slots=True)
class Queued:
    """One row of the batch. `grade` is there at once where there is nothing to grade."""

    row: HandedIn
    students: Path  # the folder of all
    code: Spooled | None = None
    sha256: str = ""
    notes: tuple[str, ...] = ()
    grade: Grade | None = None
    about: dict[str, Any] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """Where all of it is kept."""
        return self.students / safe_id(self.row.student)

    @property
    def mark(self) -> str:
        """What was handed in, for comparison: the hash of the Python, or why there is none."""
        return self.sha256 or (f"{self.grade.status}: {self.grade.reason}" if self.grade else "")


def queued(assignment: Assignment, intake: Intake, students: Path, jobs: int | None) -> list[Queued]:
    """All rows; nothing is written into a folder yet."""
    spool = Spool()
    rows = [Queued(row, students, notes=row.notes, about=_about(row)) for row in intake.rows]
    notebooks = []
    for each in rows:
        if each.row.status is not None:
            each.grade = ungraded(assignment, each, each.row.status, each.row.reason)
            continue
        try:
            data = each.row.read()
        except Refusal as error:
            each.grade = ungraded(assignment, each, status_of(error), str(error))
            continue
        each.code = spool.put(data)
        if each.row.is_notebook:
            notebooks.append(each)
        else:
            each.sha256 = hashlib.sha256(data).hexdigest()
    if notebooks:
        _convert(assignment, notebooks, spool, jobs)
    return rows


def keep(rows: list[Queued]) -> None:
    """The code of all rows in their folders, where it is not there already."""
    for each in rows:
        if each.code is not None:
            path, code = each.folder / CODE, each.code.read()
            if not path.is_file() or path.read_bytes() != code:
                write_whole(path, code)


def ungraded(assignment: Assignment, each: Queued, status: Status, reason: str) -> Grade:
    """No points, by the submission's doing; or, with a grader error, no score at all."""
    row = each.row
    scores = tuple(criterion.nothing(reason) for criterion in assignment.criteria)
    return Grade(
        student=row.student,
        status=status,
        reason=reason,
        score=0.0,
        max_score=assignment.max_score,
        before_penalty=0.0,
        criteria=scores,
        sha256=each.sha256,
        seed=assignment.seed(row.student),
        late_days=days_late(assignment.due, row.time),
        notes=each.notes,
        details={"assignment": assignment.sha256, **each.about},
    )


def _convert(assignment: Assignment, notebooks: list[Queued], spool: Spool, jobs: int | None) -> None:
    """In processes of their own: what somebody wrote to crash a parser does not crash the batch."""
    work = [(each.code, wanted(assignment)) for each in notebooks]
    for each, outcome in zip(
        notebooks, spread(_converted, work, jobs=jobs, retries=0, time_limit=_PATIENCE), strict=True
    ):
        found = outcome.value if outcome.ok else f"the notebook cannot be read: {outcome.reason}"
        if isinstance(found, Converted):
            each.code, each.notes = spool.put(found.code), (*each.notes, *found.notes)
            each.sha256 = hashlib.sha256(found.code).hexdigest()
            continue
        each.code = None
        each.grade = ungraded(assignment, each, Status.REFUSED, str(found))


def _converted(work: tuple[Spooled | None, tuple[str, ...]]) -> Converted | str:
    handed_in, names = work
    assert handed_in is not None  # a row that could not be read is no work
    confine(MEMORY)
    try:
        return converted(handed_in.read(), names)
    except Refusal as error:
        return str(error)


def _about(row: HandedIn) -> dict[str, Any]:
    """For the gradebook: which file, when, and what the export says of the student."""
    handed_in = None if row.time is None else row.time.isoformat()
    return {"file": row.name, "handed_in": handed_in, "source": row.source}
