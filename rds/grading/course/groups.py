"""Submissions of groups: one for each group, whoever of it handed in; and a row for everybody who handed in nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rds.core.errors import InputError
from rds.grading.course.class_list import ClassList
from rds.grading.grade import Status
from rds.grading.intake import HandedIn, Intake

NOTHING = "nothing was handed in"


def by_group(intake: Intake, listed: ClassList) -> Intake:
    """The rows of `intake` as the class list has them.

    The files of a group's members become one row with the group's name: the last that was handed in. Where nobody says
    which was the last, the row is refused, with the names. Students and groups of the list without a file are
    *missing*. InputError where two students of the list would be one row's.
    """
    groups = listed.groups()
    rows: list[HandedIn] = []
    of_group: dict[str, list[HandedIn]] = {name: [] for name in groups}
    seen: dict[str, str] = {}
    for row in intake.rows:
        member = listed.find(row.student, row.source)
        if member is not None and member.student in seen:
            raise InputError(
                f"{seen[member.student]!r} and {row.student!r} are both {member.student!r} of the class list; give "
                "each student a line, or keep one of the submissions"
            )
        if member is not None:
            seen[member.student] = row.student
        name = row.student if row.student in groups else member.group if member is not None else ""
        if name:
            of_group[name].append(row)
        else:
            rows.append(row)
    rows += [_of_group(name, handed_in) for name, handed_in in of_group.items()]
    rows += [
        HandedIn(each.student, status=Status.MISSING, reason=NOTHING, source=dict(each.source))
        for each in listed.members
        if not each.group and each.student not in seen
    ]
    return replace(intake, rows=tuple(sorted(rows, key=lambda row: row.student)))


def _of_group(name: str, rows: Sequence[HandedIn]) -> HandedIn:
    """What counts of all that a group's members handed in."""
    by = {row.student: row.source for row in rows}
    about = {"handed_in_by": by}
    given = [row for row in rows if row.status is not Status.MISSING]
    if not given:
        return HandedIn(name, status=Status.MISSING, reason=NOTHING, source=about)
    times = [row.time for row in given if row.time is not None]
    if len(given) == 1:
        last = given[0]
    elif len(times) == len(given) and times.count(max(times)) == 1:
        last = next(row for row in given if row.time == max(times))
    else:
        who = ", ".join(row.student for row in given)
        reason = f"{who} of group {name} handed in, and nobody says which was the last; keep one, or give times"
        return HandedIn(name, status=Status.REFUSED, reason=reason, source=about)
    notes = last.notes
    if len(given) > 1:
        notes = (*notes, f"Of group {name} the file of {last.student} is graded, the last that was handed in.")
    return replace(last, student=name, notes=notes, source={**last.source, **about})
