"""What a grader says in the panel: its fields, which of them each kind of entry needs, and the entry made of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from rds.core.errors import InputError
from rds.grading.review.entries import MOST_DAYS, Entry, Kind
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, Flag, Number, Text

_WHOM = ("student", "section")
USES: Mapping[Kind, tuple[str, ...]] = MappingProxyType(
    {
        Kind.POINTS: (*_WHOM, "criterion", "points", "final", "comment", "why"),
        Kind.COMMENT: (*_WHOM, "criterion", "comment", "why"),
        Kind.EXCUSE: (*_WHOM, "comment", "why"),
        Kind.EXTEND: (*_WHOM, "days", "comment", "why"),
        Kind.UNDO: ("entry", "why"),
    }
)
"""The fields that an entry of a kind has, besides the grader's name."""
_LABELS = {
    Kind.POINTS: "Points",
    Kind.COMMENT: "Comment",
    Kind.EXCUSE: "Excuse",
    Kind.EXTEND: "Extension",
    Kind.UNDO: "Take back",
}
_NUMBERS = {Kind.POINTS: "points", Kind.EXTEND: "days", Kind.UNDO: "entry"}


def review_fields() -> Iterable[Field]:
    """What is said, of whom, by whom; then what makes a batch of batches."""
    said = "points of a criterion, a comment, an excuse, a later due time; or an earlier entry is taken back"
    yield Choice("kind", "What", said, Kind.POINTS, {kind: _LABELS[kind] for kind in USES})
    yield _words("student", "Student", "whom it is about: an identifier of the table, or a group")
    yield _words("section", "Section", "instead of a student: a section of the class list")
    yield _words("criterion", "Criterion", "its name in the assignment; a comment without one is about the whole")
    yield Number("points", "Points", "of the criterion, instead of those measured", None, low=0.0, optional=True)
    yield Flag("final", "The last word", "it decides where graders differ", False)
    yield Number(
        "days", "Days", "by which the due time moves", None, unit="d", above=0.0, high=MOST_DAYS, optional=True
    )
    yield Number("entry", "Entry", "the number of what is taken back", None, low=1, whole=True, optional=True)
    yield _words("comment", "Comment", "the student reads it")
    yield _words("why", "Reason", "only graders read it")
    yield _words("by", "Your name", "who says it, in the audit trail")
    yield Text("attempts", "Other attempts", "folders of grades, with commas between them, the first attempt first", "")
    yield Text("new", "New folder", "for the grades that are made", "")


def entry_of(choices: Choices) -> Entry:
    """What the fields say, of which only those that the kind uses count. InputError for what is missing."""
    kind = Kind(choices["kind"])
    uses = USES[kind]
    said = {
        name: str(choices[name]).strip() if name in uses else "" for name in (*_WHOM, "criterion", "comment", "why")
    }
    value = choices[_NUMBERS[kind]] if kind in _NUMBERS else None
    by = choices["by"].strip()
    if not by:
        raise InputError("name yourself: every entry of the audit trail has its grader")
    if kind is not Kind.UNDO and bool(said["student"]) == bool(said["section"]):
        raise InputError("name the student, or the section, whom it is about")
    if kind in _NUMBERS and value is None:
        raise InputError(f"give {choices.fields[_NUMBERS[kind]].label}: {choices.fields[_NUMBERS[kind]].tooltip}")
    if kind is Kind.COMMENT and not (said["comment"] or said["why"]):
        raise InputError("write a comment, or a reason for graders")
    return Entry(
        kind,
        by,
        student=said["student"],
        section=said["section"],
        criterion=said["criterion"],
        value=None if value is None else float(value),
        comment=said["comment"],
        why=said["why"],
        is_final=kind is Kind.POINTS and bool(choices["final"]),
    )


def _words(name: str, label: str, tooltip: str) -> Text:
    """Words, and no name of a file; what is wrong with them is told when they are kept."""
    return Text(name, label, tooltip, "", "", refuse=lambda text: None)
