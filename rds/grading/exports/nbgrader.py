"""nbgrader: the columns of its own export; or, with `--gradebook`, a grade cell per criterion in its database.

The table has no columns for criteria (nbgrader's export plug-in has none), and is what other tools of nbgrader read.
"""

from __future__ import annotations

from rds.grading.batch.finished import Finished
from rds.grading.batch.grades_table import csv_text
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.nbgrader_gradebook import assignment_name, into_gradebook, naive_utc
from rds.grading.exports.roster import names_here, source
from rds.grading.grade import Grade

FILE = "nbgrader.csv"
USES = ("gradebook", "column", "points")
COLUMNS = (
    "assignment",
    "duedate",
    "timestamp",
    "student_id",
    "last_name",
    "first_name",
    "email",
    "raw_score",
    "late_submission_penalty",
    "score",
    "max_score",
)


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """`grades.csv`; or nothing but the changed database, if one is named."""
    wanted.refuse_all_but(USES, "nbgrader")
    if wanted.gradebook is not None:
        return into_gradebook(finished, wanted)
    name, factor = assignment_name(finished, wanted), scale(finished, wanted.points)
    called = names_here(finished.to_hand_on)
    rows = [_row(finished, grade, called[grade.student], name, factor) for grade in finished.to_hand_on]
    text = csv_text([COLUMNS, *rows])
    return Exported({FILE: text.encode()}, students=len(rows))


def _row(finished: Finished, grade: Grade, student: str, assignment: str, factor: float) -> list[str | float | None]:
    handed_in = finished.time(grade.student)
    numbers = (grade.before_penalty, grade.before_penalty - grade.score, grade.score, grade.max_score)
    email = source(grade, "email")
    return [
        assignment,
        naive_utc(finished.due),
        naive_utc(handed_in),
        student,
        "",
        "",
        email[0] if email else "",
        *(float(scaled(number, factor)) for number in numbers),
    ]
