"""Moodle: the downloaded grading worksheet, or a downloaded gradebook, with the grades filled in.

Moodle knows a participant by the worksheet's `Identifier`, a user of the gradebook by `ID number` or `Email address`.
It refuses columns that it did not write, so none is added. Without a download there is a table of three columns to map
by hand: `useridnumber`, `useremail` and the points.
"""

from __future__ import annotations

from rds.core.errors import InputError
from rds.grading.batch.finished import Finished
from rds.grading.batch.grades_table import csv_text
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.roster import Key, Sheet, find, identifiers, names_here, platform, read_sheet, source, unknown
from rds.grading.exports.wording import comment
from rds.grading.grade import Grade
from rds.grading.intake.names import letters

FILE = "moodle.csv"
_ESCAPE = "\\"  # to Moodle's reader of CSV a quotation mark behind it ends no cell
USES = ("gradebook", "column", "points")
_WORKSHEET = ("Identifier", "Grade", "Last modified (grade)")
KEYS = (
    Key("Identifier", lambda grade: platform(grade, "moodle", "id"), lambda cell: cell.rpartition(" ")[2]),
    Key("ID number", lambda grade: [*identifiers(grade), *source(grade, "sid")]),
    Key("Email address", lambda grade: [*source(grade, "email"), grade.student]),
    Key("Full name", lambda grade: [*source(grade, "name"), grade.student], letters),
)


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """The filled-in file. InputError where it is neither a worksheet nor a gradebook of Moodle."""
    wanted.refuse_all_but(USES, "moodle")
    if wanted.gradebook is None:
        return _plain(finished, wanted)
    sheet = read_sheet(wanted.gradebook)
    is_worksheet = all(sheet.at(name) is not None for name in _WORKSHEET)
    if not is_worksheet and sheet.at("Email address") is None and sheet.at("ID number") is None:
        raise InputError(
            f"has neither the columns of a grading worksheet ({', '.join(_WORKSHEET)}) nor 'ID number' or 'Email "
            "address' of a gradebook; download it in English, with comma as separator",
            str(wanted.gradebook),
        )
    at = _column(sheet, finished, wanted, is_worksheet)
    factor = scale(finished, wanted.points)
    found, unmatched = find(finished.to_hand_on, sheet, KEYS)
    comments = sheet.at("Feedback comments")
    for number, grade in found.items():
        row = sheet.rows[number]
        _check_points(finished, sheet, row, factor, wanted)
        row[at] = scaled(grade.score, factor)
        if comments is not None:
            row[comments] = comment(grade, factor).replace(_ESCAPE, "&#92;")
    excused, _ = find(finished.excused, sheet, KEYS)
    name = "Full name" if sheet.at("Full name") is not None else "Email address"
    return Exported({FILE: sheet.to_bytes()}, unmatched, unknown(sheet, [*found, *excused], name), len(found))


def _column(sheet: Sheet, finished: Finished, wanted: ExportOptions, is_worksheet: bool) -> int:
    """Where the points go. Moodle heads an assignment's column "Assignment: TITLE (Real)"."""
    if is_worksheet and wanted.column is None:
        at = sheet.at("Grade")
        assert at is not None  # or it is no worksheet
        return at
    name = wanted.column or finished.title
    alike = [i for i, text in enumerate(sheet.columns) if text.strip().casefold() == name.casefold()]
    alike = alike or [
        i
        for i, text in enumerate(sheet.columns)
        if text.partition(": ")[2].rpartition(" (")[0].strip().casefold() == name.casefold()
    ]
    if len(alike) != 1:
        known = ", ".join(repr(text) for text in sheet.columns)
        raise InputError(
            f"{'several columns are' if alike else 'no column is'} called {name!r}; name one by --column. There are "
            f"{known}",
            str(wanted.gradebook),
        )
    return alike[0]


def _check_points(finished: Finished, sheet: Sheet, row: list[str], factor: float, wanted: ExportOptions) -> None:
    """Moodle refuses grades above its maximum."""
    at = sheet.at("Maximum Grade")
    if at is None or not row[at].strip():
        return
    try:
        most = float(row[at].replace(",", "."))
    except ValueError:
        return
    if abs(most - finished.max_score * factor) > 1e-6 * max(1.0, most):
        raise InputError(
            f"Maximum Grade is {most:g}, and full marks are {finished.max_score * factor:g} points; give --points "
            f"{most:g} to have them scaled",
            str(wanted.gradebook),
        )


def _plain(finished: Finished, wanted: ExportOptions) -> Exported:
    factor = scale(finished, wanted.points)
    called = names_here(finished.to_hand_on)
    rows = [
        _plain_row(grade, called[grade.student], factor)
        for grade in finished.to_hand_on
        if _ESCAPE not in grade.student
    ]
    odd = [grade.student for grade in finished.to_hand_on if _ESCAPE in grade.student]
    text = csv_text([["useridnumber", "useremail", wanted.column or finished.title], *rows])
    note = "map useridnumber or useremail when Moodle asks; with --gradebook FILE the file fills in a download"
    said = "Moodle cannot read a backslash in a table; fill in this grade by hand"
    return Exported({FILE: text.encode()}, dict.fromkeys(odd, said), (note,), len(rows))


def _plain_row(grade: Grade, name: str, factor: float) -> list[str | float | None]:
    emails = source(grade, "email") or ([name] if "@" in name else [])
    numbers = source(grade, "sid") or ([] if "@" in name else [name])
    return ["".join(numbers[:1]), "".join(emails[:1]), float(scaled(grade.score, factor))]
