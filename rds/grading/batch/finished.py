"""The grades in a batch's folder, read back: what gradebooks and the class's page are made from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.grading.assignment.late_rules import LateRules
from rds.grading.batch.record import FILE as RECORD
from rds.grading.course.class_list import FILE as CLASS
from rds.grading.course.class_list import ClassList, read_class_list
from rds.grading.grade import LISTED, Grade, Status
from rds.grading.intake.names import safe_id
from rds.grading.review.class_grades import class_grades
from rds.grading.review.entries import Review, read_review

STUDENTS, GRADE, FEEDBACK = "students", "grade.json", "feedback.html"
CODE, COLUMNS = "submission.py", "columns.parquet"


def python_name(details: Mapping[str, Any]) -> str:
    """What a submission is called in messages to its author: the name handed in; of a notebook, with .py for .ipynb."""
    name = str(details.get("file") or CODE)
    return name if name.endswith(".py") else f"{name.rpartition('.')[0] or name}.py"


@dataclass(frozen=True)
class Finished:
    """The grades that count, in the order of the students' identifiers; `folders` are theirs, by identifier.

    `measured` are those that the batch has made, by the student or group that handed in; `of` says from whose a
    student's grade is.
    """

    folder: Path
    title: str
    grades: tuple[Grade, ...]
    folders: Mapping[str, Path]
    record: Mapping[str, Any] = field(default_factory=dict)
    measured: Mapping[str, Grade] = field(default_factory=dict)
    of: Mapping[str, str] = field(default_factory=dict)
    kept: Mapping[str, Path] = field(default_factory=dict)  # folders of what is `measured`
    listed: ClassList = field(default_factory=ClassList)
    review: Review = field(default_factory=Review)

    @property
    def max_score(self) -> float:
        """Points in all."""
        return max((grade.max_score for grade in self.grades), default=0.0)

    @property
    def to_hand_on(self) -> tuple[Grade, ...]:
        """The grades that a gradebook may get: all but those that the grader could not make, and excused ones."""
        return tuple(grade for grade in self.grades if grade.status not in (Status.GRADER_ERROR, Status.EXCUSED))

    @property
    def excused(self) -> tuple[Grade, ...]:
        """Students who need no grade here."""
        return tuple(grade for grade in self.grades if grade.status is Status.EXCUSED)

    @property
    def not_graded(self) -> tuple[str, ...]:
        """Students whose submission is still to be graded, or to be graded again."""
        failed = {grade.student for grade in self.grades if grade.status is Status.GRADER_ERROR}
        known = {grade.student for grade in self.grades} | set(self.measured)
        return tuple(sorted(failed | (set(self.record.get("handed_in", ())) - known)))

    def called(self, name: str) -> str:
        """The student whom the class list calls `name`, as this batch calls him; `name` itself of all others."""
        if name in self.of or name in self.of.values():
            return name
        found = [grade.student for grade in self.grades if grade.details.get(LISTED) == name]
        return found[0] if len(found) == 1 else name

    def time(self, student: str) -> datetime | None:
        """When the student, or the student's group, handed in, where that is known."""
        return as_time(self.record.get("times", {}).get(self.of.get(student, student)))

    @property
    def due(self) -> datetime | None:
        """When the assignment was due, where the record says so."""
        return as_time(self.record.get("due"))


def as_time(text: Any) -> datetime | None:
    """A time written by `isoformat`; None for anything else."""
    try:
        return datetime.fromisoformat(text) if isinstance(text, str) else None
    except ValueError:
        return None


def read_finished(folder: str | Path) -> Finished:
    """The grades in OUT, the folder of `rds grade run`. InputError for a folder that is none, or a damaged file."""
    folder = Path(folder)
    record = _json(folder / RECORD)
    if not isinstance(record, dict):
        raise InputError("is no record of a batch; name the folder that `rds grade run -o` made", str(folder / RECORD))
    found: dict[str, tuple[Grade, Path]] = {}
    places = sorted((folder / STUDENTS).glob(f"*/{GRADE}"))
    for path in places:
        try:
            grade = Grade.from_json(_json(path))
        except (TypeError, KeyError, ValueError, AttributeError) as error:
            said = f"is not a grade ({type(error).__name__}: {error}); grade this student again with --resume"
            raise InputError(said, str(path)) from error
        if grade.student in found:
            raise InputError(f"is a second grade of {grade.student!r}; remove one of them", str(path))
        found[grade.student] = grade, path.parent
    if not found:
        raise InputError("holds no grade yet; run `rds grade run` first", str(folder))
    listed = read_class_list(folder / CLASS) if (folder / CLASS).exists() else ClassList()
    review = read_review(folder)
    counting = class_grades((grade for grade, _ in found.values()), listed, review, late_rules(record))
    return Finished(
        folder,
        str(record.get("title") or folder.name),
        tuple(grade for grade, _ in counting.values()),
        {
            # a group's members have folders of their own beside the group's
            name: folder / STUDENTS / safe_id(name) if grade.student != name else found[name][1]
            for name, (_, grade) in counting.items()
        },
        record,
        {name: grade for name, (grade, _) in sorted(found.items())},
        {name: grade.student for name, (_, grade) in counting.items()},
        {name: folder for name, (_, folder) in sorted(found.items())},
        listed,
        review,
    )


def late_rules(record: Mapping[str, Any]) -> LateRules:
    """What the batch's record says of late submissions. InputError for words that this version does not know."""
    try:
        return LateRules(**record.get("late", {}))
    except TypeError as error:
        raise InputError(f"its late rules are of another version ({error}); grade into a new folder", RECORD) from error


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        said = f"cannot be read: {error.strerror}; name the folder that `rds grade run -o` made"
        raise InputError(said, str(path)) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"is damaged ({error}); grade again with --resume", str(path)) from error
