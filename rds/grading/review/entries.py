"""What graders have said of a batch, entry by entry: `review.jsonl`, an audit trail that is only ever added to.

Every entry has a number, a time, its grader and the check sum of the entry before it: one that is taken out or changed
afterwards is noticed. To take something back is an entry as well.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.grading.batch.journal import Journal, read_journal

FILE = "review.jsonl"
_LONGEST = 4000  # characters of a comment
MOST_DAYS = 366.0


class Kind(StrEnum):
    """What an entry does."""

    POINTS = "points"  # of one criterion
    COMMENT = "comment"
    EXCUSE = "excuse"
    EXTEND = "extend"  # days added to the due time, of a student or a section
    UNDO = "undo"  # another entry, by its number


@dataclass(frozen=True)
class Entry:
    """One thing that a grader said. `student` or `section` is whom it is about; `why` is for graders only."""

    kind: Kind
    by: str
    student: str = ""
    section: str = ""
    criterion: str = ""
    value: float | None = None  # points; days; the number of what is undone
    comment: str = ""  # the student reads it
    why: str = ""
    is_final: bool = False  # it decides where graders differ
    number: int = 0
    time: str = ""

    @property
    def about(self) -> str:
        """Whom it is about, in words."""
        return f"section {self.section}" if self.section else self.student


@dataclass(frozen=True)
class Review:
    """All entries of a batch, in their order."""

    entries: tuple[Entry, ...] = ()

    @property
    def standing(self) -> tuple[Entry, ...]:
        """Those that count: not undone, and not the undoing itself."""
        undone = {each.value for each in self.entries if each.kind is Kind.UNDO}
        return tuple(each for each in self.entries if each.kind is not Kind.UNDO and each.number not in undone)

    def of(self, student: str, section: str = "", group: str = "") -> tuple[Entry, ...]:
        """What counts for a student: entries about the student, the group, or the section."""
        names = {student, group} - {""}
        return tuple(
            each for each in self.standing if each.student in names or (each.section and each.section == section)
        )


def read_review(folder: Path) -> Review:
    """The entries of the batch in `folder`; none where nobody has said anything. InputError where one was changed."""
    path = folder / FILE
    return Review(tuple(_entries(read_journal(path), path)))


def add(folder: Path, said: Sequence[Entry]) -> list[Entry]:
    """Append what a grader says; the entries with their numbers and times. InputError for what will not do.

    Two graders may write at the same time: one of them waits, or is told.
    """
    added: list[Entry] = []
    with Journal(folder / FILE) as journal:
        before = _entries(journal.rows, journal.path)
        last = _sum(journal.rows[-1]) if journal.rows else ""
        for each in said:
            _check(each, [*before, *added])
            number = len(before) + len(added) + 1
            row = asdict(each) | {"number": number, "time": datetime.now(UTC).isoformat(timespec="seconds")}
            row["after"] = last
            journal.append(row)
            last = _sum(row)
            added.append(_entry(row))
    return added


def _check(entry: Entry, before: Sequence[Entry]) -> None:
    if not entry.by.strip():
        raise InputError("an entry needs its grader's name; give --by NAME")
    for text, key in ((entry.comment, "comment"), (entry.why, "why")):
        if len(text) > _LONGEST:
            raise InputError(f"the {key} has {len(text)} characters; {_LONGEST} is the most")
    if entry.value is not None and not isfinite(entry.value):
        raise InputError(f"{entry.value!r} is no number; give a finite one")
    if entry.kind is Kind.EXTEND and not 0.0 < (entry.value or 0.0) <= MOST_DAYS:
        raise InputError(f"an extension of {entry.value:g} days must be above 0 and at most {MOST_DAYS:g}")
    if entry.kind is Kind.UNDO:
        known = {each.number: each for each in before}
        found = known.get(int(entry.value or 0))
        if found is None or found.kind is Kind.UNDO:
            raise InputError(f"there is no entry {entry.value:g} to undo; --log lists them")
        if any(each.kind is Kind.UNDO and each.value == entry.value for each in before):
            raise InputError(f"entry {entry.value:g} is undone already")


def _entries(rows: Sequence[Mapping[str, Any]], path: Path) -> list[Entry]:
    found: list[Entry] = []
    last = ""
    for number, row in enumerate(rows, 1):
        if row.get("after") != last or row.get("number") != number:
            raise InputError("does not follow the line before it: an entry was changed, or taken out; restore the file",
                             f"{path}: line {number}")  # fmt: skip
        try:
            found.append(_entry(row))
        except (TypeError, ValueError, KeyError) as error:
            raise InputError(
                f"is no entry of a review that this version knows ({error})", f"{path}: {number}"
            ) from error
        last = _sum(row)
    return found


def _entry(row: Mapping[str, Any]) -> Entry:
    given = {key: value for key, value in row.items() if key != "after"}
    return Entry(**{**given, "kind": Kind(row["kind"])})


def _sum(row: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(row, sort_keys=True).encode()).hexdigest()[:32]
