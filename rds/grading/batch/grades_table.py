"""All grades of a class as one table: a line for each student, two columns for each criterion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain

from rds.grading.feedback.plain_text import cell, csv_line
from rds.grading.grade import LISTED, CriterionScore, Grade, Status
from rds.results.units import heading


def grades_csv(grades: Sequence[Grade]) -> Iterator[str]:
    """The lines of the table as CSV, for spreadsheets: headings carry units, and no cell is taken for a formula.

    A submission that the grader could not grade has no points at all, rather than none.
    """
    criteria = criteria_of(grades)
    listed = any(grade.details.get(LISTED, grade.student) != grade.student for grade in grades)
    columns = ["student", *(["class list"] if listed else []), "status", "score", "max_score", "before_penalty"]
    columns.append("late [days]")
    for criterion in criteria:
        columns.append(f"{criterion.name} [points of {_plain(criterion.max_score)}]")
        columns.append(heading(f"{criterion.name} value", "" if criterion.unit == "1" else criterion.unit))
    return _csv_lines(chain([[*columns, "reason", "sha256"]], (_row(grade, criteria, listed) for grade in grades)))


def criteria_of(grades: Iterable[Grade]) -> list[CriterionScore]:
    """One score of each criterion that occurs, in the order of the assignment: its name, unit and points."""
    found: dict[str, CriterionScore] = {}
    for grade in grades:
        for score in grade.criteria:
            found.setdefault(score.name, score)
    return list(found.values())


def csv_text(rows: Iterable[Sequence[str | float | None]]) -> str:
    """Rows as CSV. Texts are made harmless; a number is written so that reading it gives it back."""
    return "".join(_csv_lines(rows))


def _csv_lines(rows: Iterable[Sequence[str | float | None]]) -> Iterator[str]:
    for row in rows:
        yield csv_line(_cell(value) for value in row)


def _row(grade: Grade, criteria: Sequence[CriterionScore], listed: bool) -> list[str | float | None]:
    is_graded = grade.status not in (Status.GRADER_ERROR, Status.EXCUSED)
    scores = {score.name: score for score in grade.criteria} if is_graded else {}
    points = [grade.score if is_graded else None, grade.max_score, grade.before_penalty if is_graded else None]
    row: list[str | float | None] = [grade.student, *([str(grade.details.get(LISTED, ""))] if listed else [])]
    row += [str(grade.status), *points, grade.late_days]
    for criterion in criteria:
        score = scores.get(criterion.name)
        row += [None, None] if score is None else [score.score, score.value]
    return [*row, grade.reason, grade.sha256]


def _cell(value: str | float | None) -> str:
    if value is None:
        return ""
    return cell(value) if isinstance(value, str) else _plain(value)


def _plain(value: float) -> str:
    return f"{value:.12g}"
