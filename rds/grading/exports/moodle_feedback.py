"""Moodle: the feedback pages as a zip for "Upload multiple feedback files in a zip" of an assignment.

Moodle finds the participant in the name of each file, FULLNAME_ID_assignfeedback_file_NAME, by the number alone. Whose
number is not known from Moodle's own export is looked for in the grading worksheet.
"""

from __future__ import annotations

import io
import zipfile

from rds.core.errors import InputError
from rds.grading.batch.finished import FEEDBACK, Finished
from rds.grading.exports.exported import Exported, ExportOptions
from rds.grading.exports.moodle import KEYS
from rds.grading.exports.roster import find, platform, read_sheet, source
from rds.grading.grade import Grade

FILE = "moodle-feedback.zip"
USES = ("gradebook",)
_STAMP = (2000, 1, 1, 0, 0, 0)  # the same file for the same pages


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """One zip. InputError where the gradebook is no grading worksheet."""
    wanted.refuse_all_but(USES, "moodle-feedback")
    numbers = {grade.student: "".join(platform(grade, "moodle", "id")) for grade in finished.grades}
    unmatched: dict[str, str] = {}
    if wanted.gradebook is not None:
        sheet = read_sheet(wanted.gradebook)
        at = sheet.at("Identifier")
        if at is None:
            raise InputError(
                "has no column 'Identifier'; name the assignment's grading worksheet", str(wanted.gradebook)
            )
        found, unmatched = find(finished.to_hand_on, sheet, KEYS)
        numbers |= {grade.student: sheet.rows[row][at].rpartition(" ")[2] for row, grade in found.items()}
    stream, count = io.BytesIO(), 0
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for grade in finished.to_hand_on:
            page = finished.folders[grade.student] / FEEDBACK
            number = numbers[grade.student]
            if not number.isdecimal():
                said = "its number in Moodle is not known; name the grading worksheet by --gradebook"
                unmatched.setdefault(grade.student, said)
            elif not page.is_file():
                unmatched[grade.student] = "it has no feedback page; run `rds grade run` again with --resume"
            elif grade.student not in unmatched:
                name = f"{_name(grade)}_{number}_assignfeedback_file_{FEEDBACK}"
                archive.writestr(zipfile.ZipInfo(name, _STAMP), page.read_bytes(), zipfile.ZIP_DEFLATED)
                count += 1
    return Exported({FILE: stream.getvalue()}, unmatched, students=count)


def _name(grade: Grade) -> str:
    """A name for people to read. Moodle splits at underscores, and takes what is in front of a slash for a folder."""
    text = "".join(source(grade, "name")) or grade.student
    kept = "".join(each if each.isalnum() or each in " -'" else " " for each in text)
    return " ".join(kept.split())[:80] or "student"
