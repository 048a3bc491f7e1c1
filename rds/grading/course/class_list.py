"""The class list: a table of the students with their sections and groups, extensions and late days.

student,name,email,section,group,extension_days,late_days
ada,Ada Lovelace,ada@example.edu,A,red,0,3

Only `student` is needed. `extension_days` moves this student's due time, in days; `late_days` are those that the
student has left to spend in this course, whole days.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.grading.intake.names import compared, letters
from rds.grading.table_text import read_table, rows_by_heading

FILE = "class.csv"
COLUMNS = ("student", "name", "email", "section", "group", "extension_days", "late_days")
_LARGEST = 16 << 20  # bytes
_MOST_DAYS = 366.0


@dataclass(frozen=True)
class Member:
    """One student of the class. `late_days` is None where the course keeps no account of them."""

    student: str
    name: str = ""
    email: str = ""
    section: str = ""
    group: str = ""
    extension_days: float = 0.0
    late_days: int | None = None

    @property
    def source(self) -> dict[str, str]:
        """What a gradebook may know the student by."""
        return {key: text for key, text in (("name", self.name), ("email", self.email)) if text}


@dataclass(frozen=True)
class ClassList:
    """All students of a class, in the order of the file."""

    members: tuple[Member, ...] = ()

    def groups(self) -> dict[str, tuple[Member, ...]]:
        """The members of each group, by its name."""
        names = dict.fromkeys(each.group for each in self.members if each.group)
        return {name: tuple(each for each in self.members if each.group == name) for name in names}

    def sections(self) -> tuple[str, ...]:
        """The sections, in the order of the file."""
        return tuple(dict.fromkeys(each.section for each in self.members if each.section))

    def find(self, student: str, source: Mapping[str, Any] | None = None) -> Member | None:
        """Who handed in as `student`, of whom an export says `source`; None where that is nobody, or several.

        The identifier decides, then number, e-mail address and name. The number of a participant in Moodle is that of
        one assignment, and no student's.
        """
        about = source or {}
        keys = ("sid", "email") if about.get("platform") == "moodle" else ("sid", "id", "email")
        said = [student, *(str(about[key]) for key in keys if about.get(key))]
        found = self._one(said, lambda each: each.student) or self._one(said, lambda each: each.email)
        by_name = (self._one([letters(name)], lambda each: letters(each.name)) for name in _names(student, about))
        return found or next(filter(None, by_name), None)

    def namesakes(self, student: str, source: Mapping[str, Any]) -> list[Member]:
        """Several of one name, of whom it may be any who handed in as `student`; none where `find` knows."""
        names = {letters(name) for name in _names(student, source)}
        found = [each for each in self.members if each.name and letters(each.name) in names]
        return found if len(found) > 1 and self.find(student, source) is None else []

    def _one(self, said: Iterable[str], of: Callable[[Member], str]) -> Member | None:
        wanted = {compared(text) for text in said if text}
        found = [each for each in self.members if of(each) and compared(of(each)) in wanted]
        return found[0] if len(found) == 1 else None

    def to_csv(self) -> bytes:
        """As the file that `read_class_list` reads."""
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\r\n")
        writer.writerow(COLUMNS)
        for each in self.members:
            days = "" if each.late_days is None else str(each.late_days)
            texts = (each.student, each.name, each.email, each.section, each.group)
            writer.writerow([*texts, f"{each.extension_days:g}", days])
        return stream.getvalue().encode("utf-8-sig")

    def with_late_days(self, spent: Mapping[str, int]) -> ClassList:
        """The list for the next assignment: `spent` late days by student are taken off, and extensions have ended."""
        members = [
            replace(
                each,
                extension_days=0.0,
                late_days=None if each.late_days is None else max(0, each.late_days - spent.get(each.student, 0)),
            )
            for each in self.members
        ]
        return ClassList(tuple(members))


def read_class_list(path: Path) -> ClassList:
    """The table at `path`. InputError with its line for a column, a number or a student that will not do."""
    reader = rows_by_heading(read_table(path, _LARGEST, "students", "class list"), str(path))
    columns = [name.strip() for name in reader.fieldnames or ()]
    if "student" not in columns or len(set(columns)) < len(columns) or not set(columns) <= set(COLUMNS):
        raise InputError(
            f"has the columns {', '.join(columns) or 'none'}; it must have student, once, and may have "
            f"{', '.join(COLUMNS[1:])}",
            f"{path}: line 1",
        )
    reader.fieldnames = columns
    found: dict[str, Member] = {}
    for row in reader:
        place = f"{path}: line {reader.line_num}"
        if None in row or None in row.values():
            raise InputError(f"has another number of cells than the {len(columns)} headings", place)
        member = _member({key: value.strip() for key, value in row.items()}, place)
        if member.student in found:
            raise InputError(f"student {member.student!r} has a line above already; keep one of them", place)
        found[member.student] = member
    if not found:
        raise InputError("holds no student; write a line for each", str(path))
    made = ClassList(tuple(found.values()))
    if clash := sorted(set(made.groups()) & set(found)):
        raise InputError(f"{clash[0]!r} is a group and a student; give the group another name", str(path))
    return made


def _member(row: Mapping[str, str], place: str) -> Member:
    if not row["student"]:
        raise InputError("student is empty; write an identifier, or remove the line", place)
    extension, late = row.get("extension_days") or "0", row.get("late_days", "")
    student, name, email, section, group = (row.get(key, "") for key in COLUMNS[:5])
    left = _whole(late, place) if late else None
    return Member(student, name, email, section, group, days(extension, "extension_days", place), left)


def days(text: str, key: str, place: str) -> float:
    """A number of days, 0 to 366, with a point or a comma in it. InputError for anything else."""
    try:
        value = float(text.replace(",", "."))
    except ValueError:
        value = float("nan")
    if not (isfinite(value) and 0.0 <= value <= _MOST_DAYS):
        raise InputError(f"{key} = {text!r} must be a number of days from 0 to {_MOST_DAYS:g}", place)
    return value


def _whole(text: str, place: str) -> int:
    value = days(text, "late_days", place)
    if value != int(value):
        raise InputError(f"late_days = {text!r} must be a whole number of days", place)
    return int(value)


def _names(student: str, about: Mapping[str, Any]) -> list[str]:
    """What the student may be called: Moodle puts the group's name and a hyphen before it where groups hand in."""
    name = str(about.get("name") or student)
    parts = name.split("-") if about.get("platform") == "moodle" else [name]
    return ["-".join(parts[at:]) for at in range(len(parts))]
