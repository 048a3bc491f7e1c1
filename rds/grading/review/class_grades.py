"""The grades of a batch as they count: groups as their members, with reviews, extensions and late days."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from rds.grading.assignment.late_rules import LateRules
from rds.grading.course.class_list import ClassList, Member
from rds.grading.grade import LISTED, Grade
from rds.grading.review.applied import reviewed
from rds.grading.review.entries import Review

GROUP, SECTION = "group", "section"  # of a grade's details


def class_grades(
    grades: Iterable[Grade], listed: ClassList, review: Review, late: LateRules
) -> dict[str, tuple[Grade, Grade]]:
    """By student the grade that counts, and that of the batch which it is made from: of a group each member's."""
    groups = listed.groups()
    found: dict[str, tuple[Grade, Grade]] = {}
    for grade in grades:
        members: tuple[Member | None, ...] = groups.get(grade.student, ())
        if not members:
            source = grade.details.get("source")
            members = (listed.find(grade.student, source if isinstance(source, dict) else None),)
        is_group = grade.student in groups
        for member in members:
            own = _of_member(grade, member, is_group)
            group = grade.student if is_group else ""
            entries = review.of(own.student, "" if member is None else member.section, group)
            found[own.student] = reviewed(own, late, member, entries), grade
    return dict(sorted(found.items()))


def _of_member(grade: Grade, member: Member | None, is_group: bool) -> Grade:
    if member is None:
        return grade
    about: dict[str, Any] = dict(grade.details)
    source = dict(about.get("source") or {})
    by = source.pop("handed_in_by", {})
    if is_group:  # what the export says is of whoever handed in
        source = next((dict(each) for name, each in by.items() if _is(member, name, each)), {})
        about[GROUP] = grade.student
    about["source"] = {**member.source, **source}
    about[LISTED] = member.student
    if member.section:
        about[SECTION] = member.section
    return replace(grade, student=member.student if is_group else grade.student, details=about)


def _is(member: Member, student: str, source: Any) -> bool:
    return ClassList((member,)).find(student, source if isinstance(source, dict) else None) is not None
