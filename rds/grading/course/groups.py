"""Submissions of groups: one for each group, whoever of it handed in; and a row for everybody who handed in nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from typing import Any

from rds.grading.course.class_list import ClassList
from rds.grading.grade import Status
from rds.grading.intake import HandedIn, Intake
from rds.grading.intake.items import Refusal

NOTHING = "nothing was handed in"
_BEFORE_ALL = datetime.min.replace(tzinfo=UTC)
_DOUBT = (
    "{!r} may be this student's or a namesake's; write that as the student of one of them in the class list, and grade "
    "into a new folder"
)


def with_groups_of_export(intake: Intake, listed: ClassList) -> tuple[Intake, ClassList]:
    """The same, with the groups that an export (Gradescope's) names of students who have none in the class list.

    Such a group is called as its submission is there; a row is that of the group. Users write their number themselves:
    it makes nobody a member who has another e-mail address in the list, or has handed in apart.
    """
    students = {each.student for each in listed.members}
    own = [listed.find(row.student, row.source) for row in intake.rows]
    alone = Counter(each.student for each in own if each is not None)
    groups: dict[str, str] = {}  # by student
    rows = []
    for row, first in zip(intake.rows, own, strict=True):
        people, name = row.source.get("members"), str(row.source.get("submission", ""))
        members: dict[str, str] = {}
        for each in people if isinstance(people, list) else ():
            found = listed.find(each["sid"] or each["email"], each)
            if found is None or found.group not in ("", name) or alone[found.student] > (found == first):
                continue
            if found.email.casefold() in ("", each["email"].casefold()):
                members[found.student] = name
        if members and name and name not in students and row.student != name:
            groups |= members
            row = replace(row, student=name, source={**row.source, "handed_in_by": {row.student: row.source}})
        rows.append(row)
    grouped = tuple(replace(each, group=groups.get(each.student, each.group)) for each in listed.members)
    return replace(intake, rows=tuple(rows)), ClassList(grouped)


def without_groups_of_export(listed: ClassList, sources: Mapping[str, Mapping[str, Any]]) -> ClassList:
    """The list without those groups, which are of one assignment; `sources` are what the export said, by group."""
    of_export = {name for name, about in sources.items() if about.get("submission") == name}
    members = (replace(each, group="") if each.group in of_export else each for each in listed.members)
    return ClassList(tuple(members))


def by_group(intake: Intake, listed: ClassList) -> Intake:
    """The rows of `intake` as the class list has them.

    The files of a group's members become one row with the group's name: the last that was handed in. Where nobody says
    which was the last, the row is refused, with the names; so are rows that are one student of the list. Students and
    groups of the list without a file are *missing*; but a *grader error* where a file may be theirs, or a namesake's.
    """
    groups = listed.groups()
    doubts = {
        member.student: _DOUBT.format(row.student)
        for row in intake.rows
        if row.student not in groups
        for member in listed.namesakes(row.student, row.source)
    }
    members = [listed.find(row.student, row.source) for row in intake.rows]
    of_member: dict[str, list[str]] = {}
    for row, member in zip(intake.rows, members, strict=True):
        if member is not None:
            of_member.setdefault(member.student, []).append(row.student)
    rows: list[HandedIn] = []
    of_group: dict[str, list[HandedIn]] = {name: [] for name in groups}
    for row, member in zip(intake.rows, members, strict=True):
        if member is not None and len(who := of_member[member.student]) > 1:
            reason = f"{', '.join(who)} are one student of the class list, {member.student}; keep one of the files"
            row = replace(row, status=Status.REFUSED, reason=reason)
        name = row.student if row.student in groups else member.group if member is not None else ""
        if name:
            of_group[name].append(row)
        else:
            rows.append(row)
    for name, handed_in in of_group.items():
        doubt = next((doubts[each.student] for each in groups[name] if each.student in doubts), "")
        rows.append(_of_group(name, handed_in, doubt))
    rows += [
        _without_file(each.student, doubts.get(each.student, ""), dict(each.source))
        for each in listed.members
        if not each.group and each.student not in of_member
    ]
    return replace(intake, rows=tuple(sorted(rows, key=lambda row: row.student)))


def _without_file(name: str, doubt: str, source: dict[str, Any]) -> HandedIn:
    status = Status.GRADER_ERROR if doubt else Status.MISSING
    return HandedIn(name, status=status, reason=doubt or NOTHING, source=source)


def _of_group(name: str, rows: Sequence[HandedIn], doubt: str) -> HandedIn:
    """What counts of all that a group's members handed in."""
    by: dict[str, Any] = {}
    for row in rows:  # of a batch that is graded again the row is a group's already
        by |= row.source.get("handed_in_by", {row.student: row.source})
    about = {"handed_in_by": by}
    given = [row for row in rows if row.status is not Status.MISSING]
    if not given:
        return _without_file(name, doubt, about)
    times = [row.time for row in given if row.time is not None]
    latest = [row for row in given if row.time == max(times)] if len(times) == len(given) else given
    if len(latest) == 1 or _are_copies(latest):  # Moodle hands out a copy for each member
        last = max(latest, key=lambda row: row.time or _BEFORE_ALL)
    else:
        who = ", ".join(row.student for row in given)
        reason = f"{who} of group {name} handed in, and nobody says which was the last; keep one, or give times"
        return HandedIn(name, status=Status.REFUSED, reason=reason, source=about)
    notes = last.notes
    if len(given) > len(latest):
        notes = (*notes, f"Of group {name} the file of {last.student} is graded, the last that was handed in.")
    return replace(last, student=name, notes=notes, source={**last.source, **about})


def _are_copies(rows: Sequence[HandedIn]) -> bool:
    """Whether it does not matter whose file it is."""
    if any(row.status is not None for row in rows):
        return False
    try:
        return len({sha256(row.read()).digest() for row in rows}) == 1
    except Refusal:
        return False
