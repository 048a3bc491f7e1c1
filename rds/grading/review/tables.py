"""What graders see of a batch: what waits for them, and what was said so far, as rows of text for a table."""

from __future__ import annotations

from rds.grading.batch.finished import Finished
from rds.grading.review.applied import of_review
from rds.grading.review.entries import Entry, Kind

WAITING = ("student", "criterion", "what", "why")
LOG = ("entry", "time", "by", "what", "about", "criterion", "value", "words")


def waiting(finished: Finished) -> list[list[str]]:
    """What could not be measured, and where graders differ: rows of `WAITING`."""
    rows = [
        [grade.student, score.name, "could not be measured", score.sentence]
        for grade in finished.grades
        for score in grade.for_review
    ]
    return rows + [
        [grade.student, name, "graders differ", "the mean counts; a final word (--final) settles it"]
        for grade in finished.grades
        for name in of_review(grade).get("differ", ())
    ]


def behind(finished: Finished, entry: Entry) -> list[str]:
    """What else the points of an entry change: the criteria of its student that require the one that it is about."""
    said = []
    for grade in finished.grades:
        if entry.kind is Kind.POINTS and entry.student in (grade.student, finished.of[grade.student]):
            before = {score.name: score.score for score in finished.measured[finished.of[grade.student]].criteria}
            gate = next((score.title for score in grade.criteria if score.name == entry.criterion), "")
            for score in grade.criteria:
                if entry.criterion in score.gates and score.score != before[score.name]:
                    change = f"{score.score:g} points, from {before[score.name]:g} as measured"
                    said.append(f"{score.title} needs it: {change}")
                elif score.gate == gate != "" and not score.gates:  # earlier versions did not keep what gates took
                    said.append(f"{score.title} needs it and keeps {score.score:g} points; set them by hand, too")
    return said


def log(finished: Finished) -> list[list[str]]:
    """The audit trail, entry by entry: rows of `LOG`."""
    standing = {entry.number for entry in finished.review.standing}
    return [
        [
            str(entry.number),
            entry.time,
            entry.by,
            str(entry.kind) + ("" if entry.number in standing or entry.kind is Kind.UNDO else " (undone)"),
            entry.about,
            entry.criterion,
            "" if entry.value is None else f"{entry.value:g}",
            " / ".join(filter(None, (entry.comment, entry.why))),
        ]
        for entry in finished.review.entries
    ]
