"""What gradebooks say of a criterion and of a whole grade, in words."""

from __future__ import annotations

from html import escape

from rds.grading.feedback.plain_text import one_line, plain
from rds.grading.grade import CriterionScore, Grade, Status

HIDDEN = "Hidden: its value is not shown."


def of_criterion(score: CriterionScore) -> str:
    """The sentence about a criterion, as far as the student may see it."""
    return one_line(score.sentence, 1000) if score.visible else HIDDEN


def of_grade(grade: Grade) -> str:
    """Status, and lateness and points where there are some, in lines."""
    lines = []
    if grade.status is not Status.OK:
        lines.append(f"{grade.status}: {one_line(grade.reason, 1000)}")
    if grade.status in (Status.GRADER_ERROR, Status.EXCUSED):
        return lines[0]
    if grade.late_days > 0.0:
        lines.append(f"{grade.late_days:.3g} days late: {grade.before_penalty - grade.score:.4g} points are lost.")
    lines.append(f"{grade.score:.4g} of {grade.max_score:.4g} points.")
    return "\n".join(lines)


def printed(grade: Grade) -> str:
    """The notes, with what the file printed."""
    return "\n".join(plain(note) for note in grade.notes)


def comment(grade: Grade) -> str:
    """Everything in a few lines of HTML, for a gradebook's field of comments."""
    lines = of_grade(grade).split("\n")
    lines += [f"{s.title}: {s.score:.4g} of {s.max_score:.4g} points. {of_criterion(s)}" for s in grade.criteria]
    return "<br>".join(escape(one_line(line, 1500)) for line in lines)
