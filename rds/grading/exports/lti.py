"""LTI 1.3: the points of each student to the platform that they came from, by its Assignment and Grade Services.

`--gradebook` is the folder of the registration, with the launches that `rds grade lti` has kept. Points can be sent
again: the platform keeps the last. Who has never opened the assignment there has no place, and is listed.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.grading.batch.finished import Finished
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.roster import identifiers, source
from rds.grading.exports.wording import of_grade
from rds.grading.grade import Grade
from rds.grading.lti.launches import Launched, read_launches, student_of
from rds.grading.lti.registration import LAUNCHES, read_registration, tool_config, tool_key

FILE = "lti"
USES = ("gradebook", "points")
_SCORE = "https://purl.imsglobal.org/spec/lti-ags/scope/score"


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """Send all points, one after the other; nothing is written here. InputError where the platform cannot be asked."""
    wanted.refuse_all_but(USES, "lti")
    folder = wanted.gradebook
    if folder is None or not (folder / LAUNCHES).is_file():
        raise InputError(
            "points go where students were launched from: name the folder of lti.toml, in which `rds grade lti` has "
            "kept the launches, by --gradebook"
        )
    with needed_for("LTI"):
        from rds.grading.lti.library import Connector
    registration = read_registration(folder)
    config = tool_config(registration, tool_key(folder))
    connector = Connector(config.find_registration(registration.issuer))
    launches = read_launches(folder)
    factor, sent, left = scale(finished, wanted.points), 0, {}
    for grade in finished.to_hand_on:
        found = _launch_of(grade, launches)
        if found is None:
            left[grade.student] = "the platform has never opened the assignment for this student"
        elif not found.lineitem or _SCORE not in found.scopes:
            left[grade.student] = "the platform takes no points for it: switch on grades in its settings of the tool"
        elif fault := _send(connector, found, grade, finished, factor):
            left[grade.student] = fault
        else:
            sent += 1
    return Exported({}, left, students=sent)


def _launch_of(grade: Grade, launches: dict[str, Launched]) -> Launched | None:
    names = [*identifiers(grade), *(student_of("", each) for each in source(grade, "email"))]
    return next((launches[name] for name in names if name in launches), None)


def _send(connector: Any, found: Launched, grade: Grade, finished: Finished, factor: float) -> str:
    """Empty, or why the platform did not take it."""
    from pylti1p3.assignments_grades import AssignmentsGradesService
    from pylti1p3.exception import LtiException
    from pylti1p3.grade import Grade as Score
    from requests import RequestException

    when = datetime.now(UTC).isoformat(timespec="milliseconds")
    score = Score().set_score_given(float(scaled(grade.score, factor))).set_user_id(found.user).set_timestamp(when)
    score.set_score_maximum(float(scaled(finished.max_score, factor))).set_comment(of_grade(grade, factor))
    score.set_activity_progress("Completed").set_grading_progress("FullyGraded")
    about: Any = {"lineitem": found.lineitem, "scope": list(found.scopes)}
    service = AssignmentsGradesService(connector, about)
    try:
        service.put_grade(score)
    except (LtiException, RequestException, KeyError, ValueError) as error:
        return f"the platform did not take it: {error}"
    return ""
