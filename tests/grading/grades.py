"""Grades and batches' folders made for tests, without anything being graded."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rds.grading.grade import Band, CriterionScore, Grade, Status
from rds.grading.intake.names import safe_id

HOSTILE = ('=HYPERLINK("http://x")', "<img src=x onerror=alert(1)>", "\u202eevil\nline", "x" * 10_000, "'; DROP TABLE")


def score(name: str = "rms", points: float = 6.0, most: float = 10.0, **more: Any) -> CriterionScore:
    """One criterion, in the middle of its bands unless told otherwise."""
    band = Band.FULL if points == most else Band.PARTIAL if points else Band.NONE
    given = {"value": 0.23, "unit": "mm", "band": band, "sentence": f"The {name} error is 0.23 mm."} | more
    return CriterionScore(name, f"Error {name}", points, most, **given)


def grade(student: str = "ada", status: Status = Status.OK, *scores: CriterionScore, **more: Any) -> Grade:
    """A grade of two criteria, 6 + 20 of 30 points."""
    scores = scores or (score(), score("hidden", 20.0, 20.0, visible=False, sentence="secret 0.23 mm"))
    earned = sum(each.score for each in scores) if status is Status.OK else 0.0
    reason = "" if status is Status.OK else "control() returned nan at t = 0.5 s"
    given = {"score": earned, "before_penalty": earned, "max_score": sum(each.max_score for each in scores)} | more
    return Grade(student, status, reason, criteria=scores, **given)


def batch_in(
    folder: Path,
    grades: Sequence[Grade],
    /,
    title: str = "Tracking",
    pages: Mapping[str, str] | None = None,
    **record: Any,
) -> Path:
    """The folder of a batch with these grades, and `pages` of feedback by student."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "batch.json").write_text(json.dumps({"format": 1, "title": title} | record))
    for each in grades:
        place = folder / "students" / safe_id(each.student)
        place.mkdir(parents=True)
        (place / "grade.json").write_text(json.dumps(each.to_json()))
        if pages and each.student in pages:
            (place / "feedback.html").write_text(pages[each.student], encoding="utf-8")
    return folder
