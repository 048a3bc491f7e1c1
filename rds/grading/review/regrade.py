"""A batch graded again after its assignment was mended: the same files, the same times, and a list of who changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

from rds.core.atomic import write_files, write_whole
from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.batch.finished import CODE, Finished, python_name, read_finished
from rds.grading.batch.outcome import BatchOutcome
from rds.grading.batch.run import BatchOptions, grade_all
from rds.grading.course.class_list import FILE as CLASS
from rds.grading.feedback.plain_text import cell, csv_line, one_line
from rds.grading.grade import CriterionScore, Grade, Status, with_unit
from rds.grading.intake import HandedIn, Intake
from rds.grading.intake.folders import read_regular
from rds.grading.review.entries import FILE as REVIEW
from rds.grading.review.entries import Kind
from rds.grading.review.publish import publish
from rds.grading.sandbox.submission import LARGEST
from rds.results import html
from rds.results.report import page

TABLE, PAGE = "changes.csv", "changes.html"
_WITHOUT_FILE = (Status.MISSING, Status.REFUSED, Status.EXCUSED, Status.GRADER_ERROR)
_LOST = f"its {CODE} is not in the earlier batch any more; put it back, and go on with --resume"


@dataclass(frozen=True)
class Change:
    """One student whose points are others: before, now, and why, criterion by criterion."""

    student: str
    before: float
    now: float
    why: tuple[str, ...]


def regrade(old: Path, assignment: Path, out: Path, how: BatchOptions) -> tuple[BatchOutcome, list[Change]]:
    """Grade what the batch in `old` kept by the `assignment` as it is now, into the new folder `out`.

    The class list and what graders have said go along. `changes.csv` and `changes.html` in `out` say who changes and
    why. InputError where points that a grader gave have no place any more.
    """
    before = read_finished(old)
    read = read_assignment(assignment)
    points = {criterion.name: criterion.max_score for criterion in read.criteria}
    for entry in before.review.standing:
        if entry.kind is Kind.POINTS and not (entry.value or 0.0) <= points.get(entry.criterion, -1.0):
            raise InputError(
                f"entry {entry.number} of the review gives {entry.value:g} points for {entry.criterion!r}, of which "
                f"the assignment has {points.get(entry.criterion, 0.0):g} now; undo it first (--undo {entry.number})",
                str(old / REVIEW),
            )
    done = grade_all(read, lambda: _kept(before), out, how)
    if before.listed.members:
        write_whole(out / CLASS, before.listed.to_csv())
    if (old / REVIEW).exists() and not (out / REVIEW).exists():
        write_whole(out / REVIEW, (old / REVIEW).read_bytes())
    now = publish(out, read)
    changes = changes_of(before, now)
    rows = [[each.student, each.before, each.now, each.now - each.before, "; ".join(each.why)] for each in changes]
    columns = ["student", "points before", "points now", "difference", "why"]
    write_files(
        {
            out / TABLE: _csv([columns, *rows]),
            out / PAGE: _page(read.title, before, columns, rows).encode("utf-8", "replace"),
        }
    )
    return done, changes


def changes_of(before: Finished, now: Finished) -> list[Change]:
    """Whose points are others, the largest loss first. Who was not graded in one of them is told, too."""
    old, new = ({grade.student: grade for grade in each.grades} for each in (before, now))
    found = []
    for student in sorted(old.keys() | new.keys()):
        was, is_now = old.get(student), new.get(student)
        if was is None or is_now is None:
            score = (was or is_now).score if (was or is_now) else 0.0  # type: ignore[union-attr]
            found.append(
                Change(student, score if was else 0.0, score if is_now else 0.0, ("only in one of the batches",))
            )
        elif abs(was.score - is_now.score) > 1e-9 or was.status is not is_now.status:
            found.append(Change(student, was.score, is_now.score, tuple(_why(was, is_now))))
    return sorted(found, key=lambda change: (change.now - change.before, change.student))


def _why(was: Grade, now: Grade) -> list[str]:
    said = [f"{was.status} before, {now.status} now"] if was.status is not now.status else []
    old = {score.name: score for score in was.criteria}
    new = {score.name: score for score in now.criteria}
    for name in dict.fromkeys((*old, *new)):
        if name not in new:
            if old[name].score:
                said.append(f"{name}: no longer a criterion ({old[name].score:g} points before)")
        elif name not in old:
            said.append(f"{name}: a new criterion ({new[name].score:g} of {new[name].max_score:g} points)")
        elif abs(old[name].score - new[name].score) > 1e-9:
            said.append(f"{name}: {old[name].score:g} → {new[name].score:g} points, {_cause(old[name], new[name])}")
    if abs((was.before_penalty - was.score) - (now.before_penalty - now.score)) > 1e-9:
        said.append(f"late: {was.before_penalty - was.score:.4g} → {now.before_penalty - now.score:.4g} points lost")
    return said


def _cause(old: CriterionScore, new: CriterionScore) -> str:
    """What differs, the deepest cause first: the value, what it is worth, a gate, else the bands."""
    if old.value != new.value:
        return f"because its value was {_value(old)} and is {_value(new)}"
    if old.max_score != new.max_score:
        return f"because it was worth {old.max_score:g} points and is worth {new.max_score:g}"
    if old.gate and old.gate == new.gate and _of_bands(old) == _of_bands(new):
        return f"because the gate {new.gate} takes another share"
    if old.gate != new.gate:
        return f"because of the gate {new.gate}" if new.gate else f"because the gate {old.gate} takes nothing now"
    return f"because its bands are others (the same value, {_value(new)})"


def _of_bands(score: CriterionScore) -> str:
    """What its sentence says of the value and its bands, before it comes to a gate."""
    return score.sentence.partition(";")[0].rstrip(".")


def _value(score: CriterionScore) -> str:
    return "not measured" if score.value is None else with_unit(score.value, score.unit)


def _kept(before: Finished) -> Intake:
    """What the old batch kept, as it would be handed in again. Groups are groups already."""
    rows = []
    for student, grade in before.measured.items():
        details: Mapping[str, Any] = grade.details
        source = details.get("source")
        row = HandedIn(student, time=before.time(student), source=dict(source) if isinstance(source, dict) else {})
        path = before.kept[student] / CODE
        if path.is_file():
            name = python_name(details)  # what was a notebook is Python by now
            rows.append(replace(row, name=name, read=partial(read_regular, path, LARGEST)))
        else:
            is_lost = grade.status not in _WITHOUT_FILE
            status, reason = (Status.GRADER_ERROR, _LOST) if is_lost else (grade.status, grade.reason)
            rows.append(replace(row, status=status, reason=reason))
    return Intake(str(before.record.get("layout", "kept")), tuple(rows))


def _csv(rows: list[list[Any]]) -> bytes:
    lines = (csv_line(cell(each) if isinstance(each, str) else f"{each:.9g}" for each in row) for row in rows)
    return "".join(lines).encode("utf-8-sig", "replace")


def _page(title: str, before: Finished, columns: list[str], rows: list[list[Any]]) -> str:
    shown = [[one_line(row[0]), *row[1:4], one_line(row[4], 1000)] for row in rows]
    body = html.table(columns, shown) if rows else "<p>Nobody's points change.</p>"
    said = f"{len(rows)} of {len(before.grades)} students change"
    return page(f"{title}: changes", f"<header><h1>{escape(one_line(title))}: {said}</h1></header>{body}")
