"""Blackboard: the downloaded Grade Center (Work Offline, Download) with this assignment's column filled in.

Blackboard knows a student by the Username and a column by its number, "Tracking [Total Pts: 40 Score] |12345": a column
without one would become a new text column worth nothing, so the download is asked for. It is tab-delimited (UTF-16,
.xls) or comma-delimited, and goes back as it came.
"""

from __future__ import annotations

import re

from rds.core.errors import InputError
from rds.grading.batch.finished import Finished
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.roster import Key, Sheet, find, identifiers, read_sheet, source, unknown

FILE = "blackboard.xls"
USES = ("gradebook", "column", "points")
_PEOPLE = ("Last Name", "First Name", "Username", "Student ID")
_COLUMN = re.compile(r"(?P<name>.*?)\s*\[Total Pts: (?P<points>[^\]]*)\]\s*(?:\|(?P<id>\d+))?\s*")
_KEYS = (
    Key("Username", lambda grade: [*identifiers(grade), *source(grade, "sid", "email")]),
    Key("Student ID", lambda grade: [*identifiers(grade), *source(grade, "sid")]),
)


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """The file to upload. InputError without a download, or where its column has other points."""
    wanted.refuse_all_but(USES, "blackboard")
    if wanted.gradebook is None:
        raise InputError(
            "Blackboard knows a column by a number that only its own Grade Center holds: download it there (Work "
            "Offline, Download) and name it by --gradebook FILE"
        )
    sheet = read_sheet(wanted.gradebook)
    if sheet.at("Username") is None:
        raise InputError("has no column 'Username'; name the Grade Center as downloaded", str(wanted.gradebook))
    factor = scale(finished, wanted.points)
    at = _column(sheet, wanted.column or finished.title, wanted)
    _check_points(sheet.columns[at], finished, factor, wanted)
    found, unmatched = find(finished.to_hand_on, sheet, _KEYS)
    kept = [place for name in _PEOPLE if (place := sheet.at(name)) is not None]
    points = {row: scaled(grade.score, factor) for row, grade in found.items()}
    rows = [[*(row[k] for k in kept), points.get(number, row[at])] for number, row in enumerate(sheet.rows)]
    heads = [*(sheet.columns[k] for k in kept), sheet.columns[at]]
    # Blackboard asks for quotation marks around every cell between commas, and for none between tabs
    made = Sheet(heads, rows, sheet.has_mark, sheet.form, quotes_all=sheet.form[1] == ",")
    excused, _ = find(finished.excused, sheet, _KEYS)
    notes = unknown(sheet, [*found, *excused], "Username")
    return Exported({FILE: made.to_bytes()}, unmatched, notes, len(found))


def _column(sheet: Sheet, name: str, wanted: ExportOptions) -> int:
    """The assignment's column, which must have its number."""
    found = [
        (place, match)
        for place, text in enumerate(sheet.columns)
        if (match := _COLUMN.fullmatch(text)) and name.strip().casefold() in (match["name"].casefold(), text.casefold())
    ]
    if len(found) != 1 or found[0][1]["id"] is None:
        known = ", ".join(repr(text) for text in sheet.columns if _COLUMN.fullmatch(text)) or "none"
        what = "several columns are" if len(found) > 1 else "no column with a number is"
        raise InputError(f"{what} called {name!r}; name one by --column. There are {known}", str(wanted.gradebook))
    return found[0][0]


def _check_points(heading: str, finished: Finished, factor: float, wanted: ExportOptions) -> None:
    match = _COLUMN.fullmatch(heading)
    number = re.match(r"[0-9]+(?:[.,][0-9]+)?", match["points"]) if match else None
    if number is None:  # "up to 40 Score" of calculated columns, and letters, say no points
        return
    most = float(number[0].replace(",", "."))
    if abs(most - finished.max_score * factor) > 1e-6 * max(1.0, most):
        raise InputError(
            f"Total Pts of the column are {most:g}, and full marks are {finished.max_score * factor:g}; give --points "
            f"{most:g} to have them scaled",
            str(wanted.gradebook),
        )
