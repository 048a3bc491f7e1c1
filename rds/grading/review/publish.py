"""Grades as they count, written out again: the class's files, and the head of every student's page.

The pictures of a page stay as the batch has drawn them. Everything here can be made again at any time from what the
batch and the graders left.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.grading.assignment.assignment import Assignment, read_assignment
from rds.grading.batch.finished import FEEDBACK, STUDENTS, Finished, read_finished
from rds.grading.batch.journal import FILE as JOURNAL
from rds.grading.batch.journal import read_journal
from rds.grading.batch.similarity_table import found_html
from rds.grading.feedback.class_files import write_class_files
from rds.grading.feedback.feedback import basis_part, class_part, criteria_part, total_part, with_parts
from rds.grading.intake.names import safe_id

SIMILARITY = "similarity.json"


def assignment_of(finished: Finished) -> Assignment:
    """The assignment that a batch was graded by. InputError where it is gone, or has changed since."""
    folder = str(finished.record.get("folder", ""))
    try:
        read = read_assignment(folder)
    except InputError as error:
        raise InputError(
            f"the assignment of this batch cannot be read any more ({error}); put it back, or grade again by "
            "`rds grade regrade`",
            str(finished.folder),
        ) from error
    if read.sha256 != finished.record.get("assignment"):
        raise InputError(
            "the assignment has changed since this batch was graded; put it back, or use `rds grade regrade`",
            folder,
        )
    return read


def publish(out: Path, assignment: Assignment | None = None) -> Finished:
    """Write `grades.csv`, `index.html` and what has changed of the students' pages; the grades as they count."""
    finished = read_finished(out)
    read = assignment or assignment_of(finished)
    seconds = dict(read_journal(out / JOURNAL, lambda row: (row["student"], float(row["seconds"]))))
    about = f"{len(finished.grades)} students, handed in as {finished.record.get('layout', 'submissions')}"
    similar = found_html(_similar(out / SIMILARITY))
    write_class_files(
        out, read.title, finished.grades, seconds=seconds, similar=similar, about=about, review=finished.review
    )
    for path, page in _pages(finished, read):  # one by one: a class's pages together need not have room in memory
        write_whole(path, page)
    return finished


def _pages(finished: Finished, assignment: Assignment) -> Iterator[tuple[Path, bytes]]:
    """The pages that are not on the disk as they should be."""
    for grade in finished.grades:
        path = finished.folders[grade.student] / FEEDBACK
        source = finished.folder / STUDENTS / safe_id(finished.of[grade.student]) / FEEDBACK
        if not source.is_file():
            continue  # a batch from elsewhere, without pages
        page = source.read_text(encoding="utf-8")
        parts = {
            "total": total_part(grade),
            "basis": basis_part(grade),
            "criteria": criteria_part(assignment, grade),
            "class": class_part(grade, finished.grades),
        }
        made = with_parts(page, parts).encode("utf-8", "replace")
        if not path.is_file() or path.read_bytes() != made:
            yield path, made


def _similar(path: Path) -> Mapping[str, Any]:
    if not path.is_file():
        return {}
    try:
        found = json.loads(path.read_bytes())
    except ValueError as error:
        raise InputError(f"is damaged ({error}); grade again with --resume", str(path)) from error
    return found if isinstance(found, dict) else {}
