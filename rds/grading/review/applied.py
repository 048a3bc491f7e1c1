"""A grade with what graders said of it, and with its student's extensions. The batch's own grade is not changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import asdict, replace
from statistics import mean
from typing import Any

from rds.grading.assignment.late_rules import LateRules, moved
from rds.grading.course.class_list import Member
from rds.grading.criteria.criterion import GATE, in_steps
from rds.grading.grade import Band, CriterionScore, Grade, Status
from rds.grading.review.entries import Entry, Kind

REVIEW = "review"  # of a grade's details
_DIGITS = 9


def reviewed(grade: Grade, late: LateRules, member: Member | None, entries: Sequence[Entry]) -> Grade:
    """The grade that counts.

    Points of graders replace those of a criterion: of each grader the last ones. Criteria that require it count as if
    it had been measured so. Where graders differ, the mean counts until a final word; `details["review"]["differ"]`
    names these criteria. Extensions move the due time, and late days that the student has left are spent.
    """
    if grade.status is Status.GRADER_ERROR:
        return grade
    has_own = member is not None and (member.extension_days or member.late_days is not None)
    if not (entries or has_own or late.free_days):
        return grade
    earlier = of_review(grade)  # of the batch that this grade was taken from, if it is the best of several attempts
    marks = [each for each in entries if each.kind is Kind.POINTS]
    scores, differ = [], []
    for score in grade.criteria:
        of = [each for each in marks if each.criterion == score.name]
        scores.append(_marked(score, of) if of else score)
        if _differ(of):
            differ.append(score.name)
    given = {each.criterion for each in marks}
    scores = [each if each.name in given else _behind_gates(each, scores, given) for each in scores]
    before = _rounded(grade.before_penalty + sum(s.score for s in scores) - sum(s.score for s in grade.criteria))
    extension = sum(each.value or 0.0 for each in entries if each.kind is Kind.EXTEND)
    extension += member.extension_days if member else 0.0
    left = member.late_days if member else None
    days, share = grade.late_days, float(grade.details.get("late_share", 0.0))
    if extension or left is not None:
        days = moved(grade.late_days, extension)
        share = late.lost(days, left)
    spent = late.spent(days, left) if extension or left is not None or not earlier else earlier["late_days_spent"]
    said: dict[str, Any] = {
        "differ": differ,
        "comments": [*earlier.get("comments", ()), *_comments(entries)],
        "extension_days": extension + float(earlier.get("extension_days", 0.0)),
        "late_days_spent": spent,
        "by": sorted({each.by for each in entries}),
        "entries": [*earlier.get("entries", ()), *(asdict(each) for each in entries)],
    }
    made = replace(
        grade,
        criteria=tuple(scores),
        before_penalty=before,
        score=_rounded(before * (1.0 - share)),
        late_days=days,
        details={**grade.details, "late_share": share, REVIEW: said},
    )
    excuses = [each for each in entries if each.kind is Kind.EXCUSE]
    if excuses:
        said["late_days_spent"] = 0  # it counts neither for nor against the student
        return replace(made, status=Status.EXCUSED, reason=excuses[-1].comment or "excused by a grader", score=0.0)
    return made


def _comments(entries: Sequence[Entry]) -> list[dict[str, str]]:
    return [{"by": each.by, "criterion": each.criterion, "text": each.comment} for each in entries if each.comment]


def of_review(grade: Grade) -> Mapping[str, Any]:
    """What `reviewed` says in a grade's details; empty where it was not asked."""
    found = grade.details.get(REVIEW)
    return found if isinstance(found, Mapping) else {}


def is_changed(grade: Grade) -> bool:
    """Whether a grader's word or the class list had a part in this grade."""
    said = of_review(grade)
    return bool(said.get("entries") or said.get("extension_days") or said.get("late_days_spent"))


def _last_of_each(marks: Sequence[Entry]) -> dict[str, Entry]:
    return {each.by: each for each in marks}


def _decided(marks: Sequence[Entry]) -> Entry | None:
    """The last final word, if nothing but it counts."""
    return next((each for each in reversed(marks) if each.is_final), None)


def _differ(marks: Sequence[Entry]) -> bool:
    return _decided(marks) is None and len({each.value for each in _last_of_each(marks).values()}) > 1


def _marked(score: CriterionScore, marks: Sequence[Entry]) -> CriterionScore:
    final = _decided(marks)
    counted = [final] if final is not None else list(_last_of_each(marks).values())
    points = _rounded(mean(each.value or 0.0 for each in counted))
    # The value and the sentence of the measurement stay: what was measured is not a grader's to change. The student
    # reads it, so it names no grader; the trail in the class's page does.
    said = (
        f"{score.sentence} Set by hand to {points:g} of {score.max_score:g} points, from {score.score:g} as measured."
    )
    band = _band(points, score.max_score)
    # no gate takes what a grader gives, nor where this grade is the best of several attempts and is reviewed again
    return replace(score, score=points, band=band, sentence=said.strip(), gate="", ungated=None, gates={})


def _behind_gates(score: CriterionScore, everybody: Sequence[CriterionScore], given: Set[str]) -> CriterionScore:
    """A score that nobody has set, after points by hand for criteria that it requires.

    They open it or take its points as measured ones do. What could not be measured waits for a grader all the same.
    """
    by_hand = {s.name: s for s in everybody if s.name in given and s.name in score.gates and s.max_score > 0.0}
    if not by_hand or score.ungated is None or score.band is Band.REVIEW:
        return score
    gates = {**score.gates, **{name: min(s.score / s.max_score / GATE, 1.0) for name, s in by_hand.items()}}
    now, before = min(gates.values()), min(score.gates.values())
    share = now * score.ungated / score.max_score if score.max_score else 0.0
    if now < 1.0 and not score.visible:
        share = in_steps(share)
    points = _rounded(share * score.max_score)
    score = replace(score, gates=gates)
    if now == before or points == score.score:
        return score
    titles = {each.name: each.title for each in everybody}
    gate = titles[min(gates, key=lambda name: gates[name])] if now < 1.0 else ""
    names = " and ".join(s.title for s in by_hand.values())
    counts = f"{points:g} of {score.max_score:g} points count here, from {score.score:g} as measured"
    said = f"{score.sentence} {names} {'was' if len(by_hand) == 1 else 'were'} set by hand: {counts}."
    return replace(score, score=points, band=_band(points, score.max_score), sentence=said, gate=gate)


def _band(points: float, most: float) -> Band:
    return Band.FULL if points >= most else Band.PARTIAL if points > 0.0 else Band.NONE


def _rounded(points: float) -> float:
    return float(f"{points:.{_DIGITS}g}")
