"""What a student may know of a file before it is handed in: values of visible criteria, margins of hidden ones."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.grading.assignment.assignment import Assignment
from rds.grading.batch.grade_one import Opener, grade_with_runs
from rds.grading.cases.case import COUNTS
from rds.grading.criteria.criterion import Criterion
from rds.grading.grade import Band, CriterionScore, Status
from rds.grading.intake.single import as_python

_FARTHEST = 200  # % of the band, to either side: how far a hidden criterion's margin is told
_COARSE = 5  # % of the band: a hidden value is not told any finer
WORDS = {Band.FULL: "pass", Band.PARTIAL: "partly", Band.NONE: "fail", Band.REVIEW: "review"}


@dataclass(frozen=True)
class Line:
    """One criterion. `margin` is in per cent of the band: 0 where points begin, 100 where they are full.

    Of a hidden criterion `value`, `unit`, `bounds` and `sentence` say nothing.
    """

    name: str
    title: str
    band: Band
    margin: float | None
    points: float
    value: float | None = None
    unit: str = ""
    bounds: str = ""
    sentence: str = ""
    is_visible: bool = True

    @property
    def word(self) -> str:
        """pass, partly or fail."""
        return WORDS[self.band]


@dataclass(frozen=True)
class SelfCheck:
    """What is told. `left_out` are criteria that were not tried, `left_out_points` what they are worth."""

    status: Status
    reason: str
    lines: tuple[Line, ...]
    left_out: int
    left_out_points: float

    @property
    def ok(self) -> bool:
        """Whether all that was tried earns full points."""
        return self.status is Status.OK and all(line.band is Band.FULL for line in self.lines)

    def to_json(self) -> dict[str, Any]:
        """In JSON's own types."""
        keys = ("name", "title", "margin", "points", "value", "unit", "bounds", "sentence", "is_visible")
        return {
            "status": str(self.status),
            "reason": self.reason,
            "ok": self.ok,
            "criteria": [{"result": line.word} | {key: getattr(line, key) for key in keys} for line in self.lines],
            "left_out": {"criteria": self.left_out, "points": self.left_out_points},
        }


def self_check(assignment: Assignment, file: Path, student: str, pool: Opener) -> SelfCheck:
    """Try a student's own file. InputError where the assignment does not allow it, or the file is not there."""
    if assignment.self_check == "off":
        raise InputError("this assignment has no self-check", str(assignment.folder))
    if not file.is_file():
        said = "it is a folder, or no regular file" if file.exists() else "there is no such file"
        raise InputError(f"{said}; name the file that you want to hand in", str(file))
    is_blind = assignment.self_check == "blind"
    tried = [
        criterion
        for criterion in assignment.criteria
        if (criterion.is_visible or is_blind) and (pool.counts_work or COUNTS not in criterion.needs)
    ]
    if not tried:
        raise InputError(
            "no criterion of it can be tried here: all are hidden, or need the sandbox", str(assignment.folder)
        )
    seen = [criterion for criterion in tried if criterion.is_visible]
    others = [criterion for criterion in tried if not criterion.is_visible]
    with as_python(assignment, file) as path:
        first = grade_with_runs(assignment, path, student, pool, criteria=seen).grade if seen else None
        # apart, so that nothing of the hidden cases is in what is shown
        second = grade_with_runs(assignment, path, student, pool, criteria=others).grade if others else None
    lines = []
    for criteria, grade, make in ((seen, first, _line), (others, second, _blind)):
        scores = grade.criteria if grade is not None else ()
        lines += [make(criterion, score) for criterion, score in zip(criteria, scores, strict=True)]
    status, reason = Status.OK, ""
    if second is not None and second.status is not Status.OK:
        status, reason = second.status, "in a case that is hidden"
    if first is not None and first.status is not Status.OK:
        status, reason = first.status, first.reason
    order = {criterion.name: number for number, criterion in enumerate(assignment.criteria)}
    left = [criterion for criterion in assignment.criteria if criterion not in tried]
    return SelfCheck(
        status,
        reason,
        tuple(sorted(lines, key=lambda line: order[line.name])),
        len(left) + assignment.hidden.criteria,
        sum(criterion.max_score for criterion in left) + assignment.hidden.points,
    )


def margin_of(criterion: Criterion, score: CriterionScore) -> float | None:
    """In per cent of the band; None without a value."""
    return None if score.value is None else 100.0 * criterion.bands.margin(score.value)


def _line(criterion: Criterion, score: CriterionScore) -> Line:
    return Line(
        criterion.name,
        criterion.title,
        score.band,
        margin_of(criterion, score),
        score.max_score,
        score.value,
        score.unit,
        criterion.bounds,
        score.sentence,
    )


def _blind(criterion: Criterion, score: CriterionScore) -> Line:
    margin = margin_of(criterion, score)
    if margin is not None:
        margin = float(_COARSE * round(max(-_FARTHEST, min(margin, _FARTHEST)) / _COARSE))
    return Line(criterion.name, criterion.title, score.band, margin, score.max_score, is_visible=False)
