"""Words of graders checked against the batch that they are about, one by one or as a table of marks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from rds.core.errors import InputError
from rds.grading.batch.finished import Finished, read_finished
from rds.grading.feedback.plain_text import cell, csv_line, uncell
from rds.grading.grade import with_unit
from rds.grading.review.entries import Entry, Kind, add
from rds.grading.review.publish import assignment_of, publish
from rds.grading.table_text import read_table, rows_by_heading

MARKS = ("student", "criterion", "points", "comment", "why")
_LARGEST = 64 << 20  # bytes


def say(out: Path, entries: Sequence[Entry]) -> tuple[list[Entry], Finished]:
    """Add what a grader says to the batch in `out`, and write all out again. InputError for what has no place there."""
    finished = read_finished(out)
    assignment_of(finished)  # before anything is written
    entries = [replace(each, student=finished.called(each.student)) for each in entries]
    for each in entries:
        check(each, finished)
    return add(out, entries), publish(out)


def check(entry: Entry, finished: Finished) -> None:
    """InputError where an entry names a student, a section, a criterion or points that the batch does not have."""
    if entry.kind is Kind.UNDO:
        return
    groups = set(finished.of.values())
    if entry.section:
        if entry.section not in finished.listed.sections():
            known = ", ".join(finished.listed.sections()) or "none: grade with --class"
            raise InputError(f"there is no section {entry.section!r}; the class list has {known}")
    elif entry.student not in {grade.student for grade in finished.grades} | groups:
        raise InputError(f"there is no student or group {entry.student!r} in this batch; grades.csv lists them")
    criteria = {score.name: score.max_score for grade in finished.measured.values() for score in grade.criteria}
    if entry.criterion and entry.criterion not in criteria:
        raise InputError(f"there is no criterion {entry.criterion!r}; there are {', '.join(criteria)}")
    if entry.kind is Kind.POINTS:
        most = criteria.get(entry.criterion, 0.0)
        if not entry.criterion:
            raise InputError("points are those of a criterion; name it by --criterion")
        if not 0.0 <= (entry.value or 0.0) <= most:
            raise InputError(f"{entry.value:g} points of {entry.criterion!r} must be from 0 to {most:g}")


def read_marks(path: Path, by: str, is_final: bool = False) -> list[Entry]:
    """Entries from a table with the columns of `MARKS`; lines without points, comment and why say nothing."""
    reader = rows_by_heading(read_table(path, _LARGEST, "marks", "table of marks"), str(path))
    if not {"student", "criterion"} <= set(reader.fieldnames or ()):
        raise InputError(
            f"must have the columns {', '.join(MARKS)}; --write-marks makes such a table", f"{path}: line 1"
        )
    found = []
    for row in reader:
        said = {key: uncell(row.get(key) or "").strip() for key in MARKS}
        if not (said["points"] or said["comment"] or said["why"]):
            continue
        value = None
        if said["points"]:
            try:
                value = float(said["points"].replace(",", "."))
            except ValueError:
                told = f"points = {said['points']!r} is no number"
                raise InputError(told, f"{path}: line {reader.line_num}") from None
        kind = Kind.COMMENT if value is None else Kind.POINTS
        words = (said["comment"], said["why"], is_final and value is not None)
        found.append(Entry(kind, by, said["student"], "", said["criterion"], value, *words))
    if not found:
        raise InputError("holds no points and no comment; fill in some", str(path))
    return found


def marks_table(finished: Finished) -> bytes:
    """A table for a grader to fill in: a line for each student and criterion, in its last columns what was measured."""
    rows: list[Iterable[str]] = [(*MARKS, "measured points", "of", "measured")]
    for grade in finished.grades:
        for score in grade.criteria:
            value = "" if score.value is None else with_unit(score.value, score.unit, 6)
            rows.append(
                (grade.student, score.name, "", "", "", f"{score.score:g}", f"{score.max_score:g}", value or score.band)
            )
    return "".join(csv_line(map(cell, row)) for row in rows).encode("utf-8-sig", "replace")
