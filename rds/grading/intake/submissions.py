"""All submissions in a folder or an exported zip: one row for each student, whatever was handed in.

intake = collect("submissions.zip", accepted=("controller.py",), assignments=("ps1",), zone=due.tzinfo)
for row in intake.rows:
    print(row.student, row.status or row.name)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, tzinfo
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.grading.grade import Status
from rds.grading.intake import notebooks
from rds.grading.intake.archives import files_in
from rds.grading.intake.choose import NothingToGrade, chosen
from rds.grading.intake.folders import files_below, read_regular
from rds.grading.intake.items import CODE, Item, Refusal, Unreadable
from rds.grading.intake.layouts import StudentFiles, sorted_out
from rds.grading.intake.names import shown
from rds.grading.intake.times import listed_times, stamped_time, with_zone
from rds.grading.sandbox.submission import LARGEST


@dataclass(frozen=True, slots=True)
class HandedIn:
    """What one student handed in. `status` says why there is nothing to grade, with its `reason`; else None.

    `read()` gives the file, Refusal if that cannot be had after all. `source` is what the export says of the student.
    """

    student: str
    name: str = ""
    read: Callable[[], bytes] = bytes
    status: Status | None = None
    reason: str = ""
    time: datetime | None = None
    notes: tuple[str, ...] = ()
    source: dict[str, Any] = field(default_factory=dict)

    @property
    def is_notebook(self) -> bool:
        """Whether it has to be converted before it can be graded."""
        return self.name.lower().endswith(".ipynb")


@dataclass(frozen=True)
class Intake:
    """All rows by student, the layout that was found, and files that belong to nobody."""

    layout: str
    rows: tuple[HandedIn, ...]
    ignored: tuple[str, ...] = ()


def collect(
    place: str | Path,
    accepted: Sequence[str] = (),
    assignments: Sequence[str] = (),
    zone: tzinfo | None = None,
) -> Intake:
    """The submissions in the folder, exported zip or single file `place`.

    `accepted` are the names that a submission's file should have, best first; `assignments` those by which nbgrader
    may know the assignment; `zone` is the time zone of times that say none. InputError if there is no such place, or
    nothing in it.
    """
    path = Path(place)
    if path.is_dir():
        items, folders = files_below(path)
        zipped = False
    elif path.suffix.lower() == ".zip":
        items, folders = files_in(path)
        zipped = True
    elif path.is_file() and path.suffix.lower() in CODE:
        items, folders, zipped = [_single(path)], [], False
    else:
        raise InputError("is no folder, no .zip and no submission; name where the submissions are", str(path))
    layout = sorted_out(items, folders, assignments, zipped, accepted, path.resolve().stem)
    if not layout.by_student:
        raise InputError("holds no submissions: no .py, no .ipynb and no folder of a student", str(path))
    listed = listed_times(layout, zone)
    rows = tuple(_row(handed, accepted, listed.get(handed.student), zone) for handed in layout.by_student)
    return Intake(layout.name, rows, layout.ignored)


def _single(path: Path) -> Item:
    return Item((path.name,), lambda most: read_regular(path, most))


def _row(handed: StudentFiles, accepted: Sequence[str], listed: datetime | None, zone: tzinfo | None) -> HandedIn:
    when = listed or with_zone(stamped_time(handed), zone)
    status, reason, item = None, "", None
    try:
        item = chosen(handed, accepted)
    except NothingToGrade as error:
        status, reason = Status.MISSING, str(error)
    except Refusal as error:
        status, reason = status_of(error), str(error)
    if when is None and item is not None and handed.has_times:
        when = with_zone(item.time, zone)
    name = "" if item is None else shown(item.name)
    read = bytes if item is None else _reader(item)
    return HandedIn(handed.student, name, read, status, reason, when, tuple(handed.notes), handed.source)


def status_of(error: Refusal) -> Status:
    """Of a student whose file is not opened: what the computer keeps from who grades is not the student's fault."""
    return Status.GRADER_ERROR if isinstance(error, Unreadable) else Status.REFUSED


def _reader(item: Item) -> Callable[[], bytes]:
    most = notebooks.LARGEST if item.name.lower().endswith(".ipynb") else LARGEST
    return lambda: item.read(most)
