"""PrairieLearn: `results.json` of an external grader for each student, a test for each criterion, at most 1 MB."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rds.grading.batch.finished import Finished
from rds.grading.exports import one_json
from rds.grading.exports.exported import Exported, ExportOptions
from rds.grading.exports.pictures import Picture
from rds.grading.exports.wording import of_criterion, of_grade, printed
from rds.grading.feedback.plain_text import one_line
from rds.grading.grade import CriterionScore, Grade, Status

FILE = "prairielearn"
_NOT_GRADABLE = (Status.MISSING, Status.REFUSED, Status.FAILED_TO_LOAD)
_NO_SCORE = (Status.GRADER_ERROR, Status.EXCUSED)


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """A folder for each student with `results.json`."""
    wanted.refuse_all_but((), "prairielearn")
    return one_json.each_student(finished, results)


def results(grade: Grade, pictures: Sequence[Picture]) -> dict[str, Any]:
    """What PrairieLearn reads; its score is a share, 0 to 1.

    A file that could not be loaded is not gradable, which costs the student no attempt; unless a grader gave points.
    """
    said = f"{grade.status}: {one_line(grade.reason, 1000)}"
    if grade.status in _NO_SCORE or (grade.status in _NOT_GRADABLE and not grade.before_penalty):
        return {"gradable": False, "format_errors": [said], "message": said, "output": printed(grade)}
    share = grade.score / grade.max_score if grade.max_score > 0.0 else 0.0
    return {
        "gradable": True,
        "score": min(max(share, 0.0), 1.0),
        "message": of_grade(grade),
        "output": printed(grade),
        "images": [{"label": picture.label, "url": picture.url} for picture in pictures],
        "tests": [_test(score) for score in grade.criteria],
    }


def _test(score: CriterionScore) -> dict[str, Any]:
    return {
        "name": score.title,
        "description": f"{score.max_score:.4g} points",
        "points": score.score,
        "max_points": score.max_score,
        "message": of_criterion(score),
    }
