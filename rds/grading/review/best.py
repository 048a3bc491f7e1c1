"""Attempts: several batches of one assignment, of which each student's best grade counts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.private_files import make_folder, write_private
from rds.grading.batch.finished import CODE, COLUMNS, FEEDBACK, GRADE, STUDENTS, Finished, read_finished
from rds.grading.batch.record import FILE as RECORD
from rds.grading.course.class_list import FILE as CLASS
from rds.grading.grade import Grade, Status
from rds.grading.intake.names import safe_id
from rds.grading.review.publish import assignment_of, publish


def best(batches: Sequence[Path], out: Path) -> Finished:
    """Write the best grade of each student, as it counts in its batch, into the new folder `out`: a batch as well.

    Of equal grades the first counts. The note of a grade says which attempt it is, and what the others earned. Late
    days and extensions are those of the attempt. InputError where the batches are not of one assignment.
    """
    if len(batches) < 2:
        raise InputError("name the folders of two batches or more")
    if out.exists() and any(out.iterdir()):
        raise InputError("is not empty; name a new folder", str(out))
    finished = [read_finished(path) for path in batches]
    read = assignment_of(finished[-1])
    for path, each in zip(batches, finished, strict=True):
        if each.record.get("assignment") != read.sha256:
            raise InputError(f"is a batch of another assignment, or version of it, than {batches[-1]}", str(path))
    make_folder(out / STUDENTS)
    times: dict[str, str] = {}
    for student in sorted({grade.student for each in finished for grade in each.grades}):
        number, grade = _best(finished, student)
        source = finished[number]
        if when := source.time(student):
            times[student] = when.isoformat()
        _copy(source, replace(grade, notes=(*grade.notes, _note(finished, student, number))), out)
    members = finished[-1].listed.with_late_days({})
    if members.members:  # extensions and late days are in the grades already, and groups are their members
        alone = [replace(each, group="", late_days=None) for each in members.members]
        write_whole(out / CLASS, replace(members, members=tuple(alone)).to_csv())
    record = dict(finished[-1].record) | {
        "handed_in": {each.student: each.sha256 for f in finished for each in f.grades},
        "times": times,
        "layout": f"the best of {len(batches)} attempts",
    }
    write_whole(out / RECORD, json.dumps(record, indent=1, sort_keys=True).encode() + b"\n")
    return publish(out, read)


def _best(finished: Sequence[Finished], student: str) -> tuple[int, Grade]:
    """The number of the batch, and the grade in it. A grader error is no attempt if there is another one.

    To have handed in nothing is none at all, unless a grader has given points for it: beside it a grader error stands,
    and is no zero.
    """
    found = [(n, grade) for n, each in enumerate(finished) for grade in each.grades if grade.student == student]
    rank = {Status.GRADER_ERROR: 1, Status.MISSING: 2}
    return min(found, key=lambda pair: (0 if pair[1].score else rank.get(pair[1].status, 0), -pair[1].score, pair[0]))


def _note(finished: Sequence[Finished], student: str, number: int) -> str:
    said = []
    for n, each in enumerate(finished):
        score = next((_points(grade) for grade in each.grades if grade.student == student), "none")
        said.append(f"{n + 1}: {score}{' (counts)' if n == number else ''}")
    return f"Points of {len(finished)} attempts: {', '.join(said)}."


def _points(grade: Grade) -> str:
    is_graded = grade.status not in (Status.GRADER_ERROR, Status.EXCUSED)
    return f"{grade.score:g}" if is_graded else str(grade.status)


def _copy(source: Finished, grade: Grade, out: Path) -> None:
    target = out / STUDENTS / safe_id(grade.student)
    make_folder(target)
    kept = source.kept[source.of[grade.student]]
    for name in (CODE, COLUMNS):
        if (kept / name).is_file():
            with (kept / name).open("rb") as stream:
                write_private(target / name, stream.read())
    page = source.folders[grade.student] / FEEDBACK
    if page.is_file():
        write_private(target / FEEDBACK, page.read_bytes())
    write_whole(target / GRADE, json.dumps(grade.to_json(), indent=1, allow_nan=False).encode() + b"\n")
