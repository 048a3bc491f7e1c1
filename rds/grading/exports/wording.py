"""What gradebooks say of a criterion and of a whole grade, in words."""

from __future__ import annotations

from html import escape

from rds.grading.assignment.late_rules import told_days
from rds.grading.feedback.plain_text import one_line, plain
from rds.grading.grade import CriterionScore, Grade, Status

HIDDEN = "Hidden: its value is not shown."


def of_criterion(score: CriterionScore) -> str:
    """The sentence about a criterion, as far as the student may see it."""
    return one_line(score.sentence, 1000) if score.visible else HIDDEN


def of_grade(grade: Grade, factor: float = 1.0) -> str:
    """Status, and lateness and points where there are some, in lines; the gradebook's points are `factor` of ours."""
    lines = []
    if grade.status is not Status.OK:
        lines.append(f"{grade.status}: {one_line(grade.reason, 1000)}")
    if grade.status in (Status.GRADER_ERROR, Status.EXCUSED):
        return lines[0]
    if grade.late_days > 0.0:
        lost = factor * (grade.before_penalty - grade.score)
        lines.append(f"{told_days(grade.late_days)} late: {lost:.4g} points are lost.")
    own = "" if factor == 1.0 else f" ({grade.score:.4g} of the {grade.max_score:.4g} points on the feedback page)"
    lines.append(f"{of_most(grade, factor)}{own}.")
    return "\n".join(lines)


def of_most(earned: Grade | CriterionScore, factor: float) -> str:
    """The points earned, of how many, as a gradebook counts them."""
    return f"{factor * earned.score:.4g} of {factor * earned.max_score:.4g} points"


def printed(grade: Grade) -> str:
    """The notes, with what the file printed."""
    return "\n".join(plain(note) for note in grade.notes)


def comment(grade: Grade, factor: float = 1.0) -> str:
    """Everything in a few lines of HTML, for a gradebook's field of comments; `factor` as of `of_grade`."""
    lines = of_grade(grade, factor).split("\n")
    lines += [f"{s.title}: {of_most(s, factor)}. {of_criterion(s)}" for s in grade.criteria]
    return "<br>".join(escape(one_line(line, 1500)) for line in lines)
