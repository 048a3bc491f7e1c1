"""Grades into nbgrader's own database, through nbgrader's interface: a grade cell for each criterion.

The cells are those of a notebook called `rds` that the assignment gets beside its own. Doing it again replaces what was
there, and touches nothing else.
"""

from __future__ import annotations

import warnings
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.installed import pip_install
from rds.grading.batch.finished import Finished
from rds.grading.batch.grades_table import criteria_of
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.roster import names_here, platform
from rds.grading.grade import Grade

NOTEBOOK = "rds"


def into_gradebook(finished: Finished, wanted: ExportOptions) -> Exported:
    """Write the grades into the database `wanted.gradebook`, under the assignment `wanted.column`.

    By default that is called as in nbgrader's folders, else by the title.
    A database with students keeps to them: others are named as unmatched. One without gets all. InputError where
    nbgrader is not installed in this Python, or refuses.
    """
    try:
        from nbgrader.api import Gradebook  # type: ignore[import-not-found]
    except ImportError as error:
        raise InputError(
            "--gradebook needs nbgrader in the same Python as rds; install it with: "
            f"{pip_install('nbgrader')}; or leave --gradebook out, and get a table"
        ) from error
    path = Path(str(wanted.gradebook)).resolve()
    if not path.is_file():
        raise InputError("is not there; name the gradebook.db of your course", str(path))
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module=r"nbgrader\.api")  # its own use of its database
            with Gradebook(f"sqlite:///{path}") as gradebook:
                return _write(gradebook, finished, wanted)
    except InputError:
        raise
    except Exception as error:  # of the database, whatever library it comes from
        raise InputError(f"nbgrader cannot write into it: {type(error).__name__}: {error}", str(path)) from error


def _write(gradebook: Any, finished: Finished, wanted: ExportOptions) -> Exported:
    name, factor = assignment_name(finished, wanted), scale(finished, wanted.points)
    due = naive_utc(finished.due)
    gradebook.update_or_create_assignment(name, **({"duedate": due} if due else {}))
    gradebook.update_or_create_notebook(NOTEBOOK, name)
    for criterion in criteria_of(finished.grades):
        points = float(scaled(criterion.max_score, factor))
        gradebook.update_or_create_grade_cell(criterion.name, NOTEBOOK, name, max_score=points, cell_type="code")
    known = {student.id for student in gradebook.students}
    unmatched: dict[str, str] = {}
    called = names_here(finished.to_hand_on)
    for grade in finished.to_hand_on:
        student = called[grade.student]
        if known and student not in known and grade.student not in called.values():  # who may be somebody else
            student = grade.student
        if known and student not in known:
            unmatched[grade.student] = "no student of the gradebook has this identifier"
            continue
        _student(gradebook, finished, grade, student, name, factor)
    count = len(finished.to_hand_on) - len(unmatched)
    return Exported({}, unmatched, (f"assignment {name!r}, notebook {NOTEBOOK!r}",), count)


def _student(gradebook: Any, finished: Finished, grade: Grade, student: str, name: str, factor: float) -> None:
    gradebook.update_or_create_student(student)
    time = naive_utc(finished.time(grade.student))
    gradebook.update_or_create_submission(name, student, **({"timestamp": time} if time else {}))
    notebook = _notebook(gradebook, name, student)
    for score in grade.criteria:
        given = gradebook.find_grade(score.name, NOTEBOOK, name, student)
        given.auto_score, given.manual_score = float(scaled(score.score, factor)), None
        given.needs_manual_grade = False
    lost = grade.before_penalty - grade.score
    notebook.late_submission_penalty = float(scaled(lost, factor)) if lost > 0.0 else None
    gradebook.db.commit()


def _notebook(gradebook: Any, assignment: str, student: str) -> Any:
    """The student's copy of the notebook, with a grade for each of its cells; a submission of before has none."""
    from nbgrader.api import Grade as CellGrade
    from nbgrader.api import MissingEntry, SubmittedNotebook

    source = gradebook.find_notebook(NOTEBOOK, assignment)
    try:
        notebook = gradebook.find_submission_notebook(NOTEBOOK, assignment, student)
    except MissingEntry:
        submission = gradebook.find_submission(assignment, student)
        notebook = SubmittedNotebook(notebook=source, assignment=submission)
        gradebook.db.add(notebook)
        gradebook.db.commit()
    has = {grade.cell_id for grade in notebook.grades}
    for cell in source.grade_cells:
        if cell.id not in has:
            gradebook.db.add(CellGrade(cell_id=cell.id, notebook=notebook))
    gradebook.db.commit()
    return notebook


def assignment_name(finished: Finished, wanted: ExportOptions) -> str:
    """The instructor's word, else the name in nbgrader's folders from which the submissions came, else the title."""
    names = {name for grade in finished.grades for name in platform(grade, "nbgrader", "assignment")}
    return wanted.column or (names.pop() if len(names) == 1 else finished.title)


def naive_utc(time: object) -> str:
    """A time as nbgrader keeps it, in UTC without saying so; empty where there is none."""
    if not isinstance(time, datetime):
        return ""
    return time.astimezone(UTC).replace(tzinfo=None, microsecond=0).isoformat(" ")
