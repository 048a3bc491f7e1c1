"""Canvas: the instructor's own gradebook with one column of points.

Canvas knows students by the `ID` of its own export, so that is asked for. The lines that tell it what the columns are
("Points Possible") stay; of the columns only the students' and the assignment's do, so that no other grade can change.
"""

from __future__ import annotations

import re

from rds.core.errors import InputError
from rds.grading.batch.finished import Finished
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.roster import Key, Sheet, find, identifiers, platform, read_sheet, source, unknown
from rds.grading.intake.names import letters

FILE = "canvas.csv"
USES = ("gradebook", "column", "points")
STUDENT = ("Student", "ID", "SIS User ID", "SIS Login ID", "Integration ID", "Root Account", "Section")
_NEEDED = ("Student", "ID", "Section")
_POINTS = "points possible"
_OWN = re.compile(r"(?:Current|Final) (?:Score|Points|Grade)|Override (?:Score|Grade|Status)")
_EXCUSED = "EX"  # Canvas's own word for a student who needs no grade
_KEYS = (
    Key("ID", lambda grade: platform(grade, "canvas", "id")),
    Key("SIS User ID", lambda grade: [*identifiers(grade), *source(grade, "sid")]),
    Key("SIS Login ID", lambda grade: [*identifiers(grade), *source(grade, "email", "sid")]),
    Key("Student", lambda grade: [*source(grade, "name"), grade.student], letters),
)


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """The file to import. InputError without a gradebook, or where its points are others."""
    wanted.refuse_all_but(USES, "canvas")
    if wanted.gradebook is None:
        raise InputError(
            "Canvas knows students by an ID that only its own gradebook holds: export it there (Grades, Export) and "
            "name it by --gradebook FILE.csv"
        )
    sheet = read_sheet(wanted.gradebook)
    missing = [name for name in _NEEDED if sheet.at(name) is None]
    if missing:
        raise InputError(
            f"has no column {missing[0]!r}; name the gradebook as Canvas exports it", str(wanted.gradebook)
        )
    factor = scale(finished, wanted.points)
    at = _column(sheet, wanted.column or finished.title, wanted)
    head, people = _split(sheet)
    _check_points(finished, head, at, factor, wanted)
    found, unmatched = find(finished.to_hand_on, people, _KEYS)
    kept = [place for name in STUDENT if (place := sheet.at(name)) is not None]
    heading = sheet.columns[at] if at is not None else wanted.column or finished.title
    if own := _OWN.search(heading):
        raise InputError(
            f"Canvas leaves out every column with {own[0]!r} in its heading, as one of its own; rename the assignment "
            "there, or enter these points by hand",
            str(wanted.gradebook),
        )
    rows = [[*(row[k] for k in kept), _head_cell(row, at, finished, factor)] for row in head]
    points = {number: scaled(grade.score, factor) for number, grade in found.items()}
    excused, _ = find(finished.excused, people, _KEYS)
    points |= dict.fromkeys(excused, _EXCUSED)
    for number, row in enumerate(people.rows):  # a cell that is as it was changes nothing there
        rows.append([*(row[k] for k in kept), points.get(number, "" if at is None else row[at])])
    made = Sheet([*(sheet.columns[k] for k in kept), heading], rows, sheet.has_mark)
    notes: tuple[str, ...] = (
        () if at is not None else (f"the gradebook has no column {heading!r}: Canvas will ask what it is",)
    )
    return Exported({FILE: made.to_bytes()}, unmatched, notes + unknown(people, points, "Student"), len(found))


def _column(sheet: Sheet, name: str, wanted: ExportOptions) -> int | None:
    """The assignment's column; Canvas writes its number behind the title: "Tracking (1234)"."""
    found = [
        place
        for place, text in enumerate(sheet.columns)
        if text.strip() == name or re.sub(r"\s*\(\d+\)\s*$", "", text).strip().casefold() == name.strip().casefold()
    ]
    if len(found) > 1:
        said = ", ".join(repr(sheet.columns[place]) for place in found)
        raise InputError(f"has several columns {name!r}; name one by --column: {said}", str(wanted.gradebook))
    if not found and wanted.column is not None:
        raise InputError(f"has no column {name!r}; there are {', '.join(sheet.columns)}", str(wanted.gradebook))
    return found[0] if found else None


def _split(sheet: Sheet) -> tuple[list[list[str]], Sheet]:
    """The lines about columns, which have no ID, and those of students."""
    at = sheet.at("ID")
    assert at is not None  # by `export`
    head = [row for row in sheet.rows if not row[at].strip()]
    people = [row for row in sheet.rows if row[at].strip()]
    return head, Sheet(sheet.columns, people, sheet.has_mark)


def _is_points(row: list[str]) -> bool:
    return any(cell.strip().casefold() == _POINTS for cell in row)


def _head_cell(row: list[str], at: int | None, finished: Finished, factor: float) -> str:
    if at is not None:
        return row[at]
    return scaled(finished.max_score, factor) if _is_points(row) else ""


def _check_points(
    finished: Finished, head: list[list[str]], at: int | None, factor: float, wanted: ExportOptions
) -> None:
    for row in head:
        if at is None or not _is_points(row):
            continue
        try:
            most = float(row[at])
        except ValueError:
            continue
        if abs(most - finished.max_score * factor) > 1e-6 * max(1.0, most):
            raise InputError(
                f"Points Possible of the column are {most:g}, and full marks are {finished.max_score * factor:g}; give "
                f"--points {most:g} to have them scaled",
                str(wanted.gradebook),
            )
