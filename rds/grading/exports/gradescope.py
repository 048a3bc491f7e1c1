"""Gradescope: `results.json` of an autograder for each student, a test for each criterion.

A hidden criterion is shown after publishing, without its value; instructors find the value in its `extra_data`.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from rds.grading.batch.finished import Finished
from rds.grading.exports import one_json
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.pictures import Picture
from rds.grading.exports.wording import of_criterion, of_grade, printed
from rds.grading.grade import Band, CriterionScore, Grade, Status

FILE = "gradescope"
USES = ("points",)


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """A folder for each student with `results.json`."""
    wanted.refuse_all_but(USES, "gradescope")
    factor = scale(finished, wanted.points)
    return one_json.each_student(finished, lambda grade, pictures: results(grade, pictures, factor))


def results(grade: Grade, pictures: Sequence[Picture], factor: float = 1.0) -> dict[str, Any]:
    """What Gradescope reads. Who could not be graded, or is excused, has no score: it then says that it failed."""
    shown = [f"<p>{escape(line)}</p>" for line in of_grade(grade, factor).split("\n") if line]
    shown += [f'<p>{escape(p.label)}</p><img alt="{escape(p.label)}" src="{escape(p.url)}">' for p in pictures]
    if text := printed(grade):
        shown.append(f"<pre>{escape(text)}</pre>")
    found: dict[str, Any] = {
        "output": "".join(shown),
        "output_format": "html",
        "visibility": "visible",
        "stdout_visibility": "hidden",
        "extra_data": {"status": str(grade.status), "late_days": grade.late_days, "sha256": grade.sha256},
    }
    if grade.status in (Status.GRADER_ERROR, Status.EXCUSED):
        return found
    tests = [_test(score, number, factor) for number, score in enumerate(grade.criteria, 1)]
    return found | {"score": float(scaled(grade.score, factor)), "tests": tests}


def _test(score: CriterionScore, number: int, factor: float) -> dict[str, Any]:
    status = {} if score.band is Band.REVIEW else {"status": "passed" if score.band is Band.FULL else "failed"}
    return status | {
        "name": score.title,
        "number": str(number),
        "score": float(scaled(score.score, factor)),
        "max_score": float(scaled(score.max_score, factor)),
        "output": of_criterion(score),
        "output_format": "text",
        "visibility": "visible" if score.visible else "after_published",
        "tags": [score.name],
        "extra_data": {"value": score.value, "unit": score.unit, "band": str(score.band), "case": score.case},
    }
