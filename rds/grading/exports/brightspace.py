"""Brightspace: a file to import (Grades, Enter Grades, Import), with the points of one grade item.

Its columns are those of Brightspace's own sample: OrgDefinedId and Username, the item's name followed by "Points
Grade", and the end-of-line indicator. From an exported gradebook only the students' own columns and the item's are
taken, so that no other grade can change.
"""

from __future__ import annotations

import re

from rds.core.errors import InputError
from rds.grading.batch.finished import Finished
from rds.grading.exports.exported import Exported, ExportOptions, scale, scaled
from rds.grading.exports.roster import Key, Sheet, find, identifiers, names_here, read_sheet, source, unknown

FILE = "brightspace.csv"
USES = ("gradebook", "column", "points")
_END, _MARK = "End-of-Line Indicator", "#"
_IDS = ("OrgDefinedId", "Username")
_ITEM = re.compile(r"(?P<name>.*) Points Grade(?: <(?P<about>.*)>)?\s*", re.IGNORECASE)
_MOST = re.compile(r"MaxPoints:([0-9.]+)", re.IGNORECASE)


def _bare(cell: str) -> str:
    return cell.strip().removeprefix(_MARK)  # Brightspace writes it before every OrgDefinedId and Username


_KEYS = (
    Key("OrgDefinedId", lambda grade: [*source(grade, "sid"), *identifiers(grade)], _bare),
    Key("Username", lambda grade: [*identifiers(grade), *source(grade, "email", "sid")], _bare),
    Key("Email", lambda grade: [*source(grade, "email"), grade.student]),
)


def export(finished: Finished, wanted: ExportOptions) -> Exported:
    """The file. InputError for a gradebook that is none of Brightspace's, or whose item has other points."""
    wanted.refuse_all_but(USES, "brightspace")
    factor, item = scale(finished, wanted.points), wanted.column or finished.title
    if wanted.gradebook is None:
        heads = ["Username", f"{item} Points Grade", _END]
        called = names_here(finished.to_hand_on)
        rows = [[_text(called[each.student]), scaled(each.score, factor), _MARK] for each in finished.to_hand_on]
        note = "students are known by Username; with --gradebook FILE they are found in your own export"
        return Exported({FILE: Sheet(heads, rows, False).to_bytes()}, notes=(note,), students=len(rows))
    sheet = read_sheet(wanted.gradebook)
    kept = [at for name in _IDS if (at := sheet.at(name)) is not None]
    if not kept:
        raise InputError(f"has neither {_IDS[0]} nor {_IDS[1]}; export the grades with both", str(wanted.gradebook))
    heading = _heading(sheet, item, finished, factor, wanted)
    found, unmatched = find(finished.to_hand_on, sheet, _KEYS)
    own = sheet.at(heading)
    points = {row: scaled(grade.score, factor) for row, grade in found.items()}
    rows = [
        [*(row[at] for at in kept), points.get(number, "" if own is None else row[own]), _MARK]
        for number, row in enumerate(sheet.rows)
    ]
    made = Sheet([*(sheet.columns[at] for at in kept), heading, _END], rows, sheet.has_mark)
    known = any(_ITEM.fullmatch(name) and heading == name for name in sheet.columns)
    notes: tuple[str, ...] = (
        () if known else (f"the gradebook has no item {item!r}: Brightspace will offer to create it",)
    )
    excused, _ = find(finished.excused, sheet, _KEYS)
    notes += unknown(sheet, [*points, *excused], sheet.columns[kept[-1]])
    return Exported({FILE: made.to_bytes()}, unmatched, notes, len(found))


def _heading(sheet: Sheet, item: str, finished: Finished, factor: float, wanted: ExportOptions) -> str:
    """The item's column as Brightspace wrote it, if it is there once and its points are ours."""
    called = [
        (name, match["about"] or "")
        for name in sheet.columns
        if (match := _ITEM.fullmatch(name)) and match["name"].strip().casefold() == item.strip().casefold()
    ]
    if len(called) > 1:
        said = ", ".join(repr(name) for name, _ in called)
        raise InputError(
            f"has several items {item!r} ({said}); leave the columns of all but one out of the export",
            str(wanted.gradebook),
        )
    if not called and wanted.column is not None:
        raise InputError(f"has no item {item!r}; there are {', '.join(sheet.columns)}", str(wanted.gradebook))
    for name, about in called:
        most = _MOST.search(about)
        if most and abs(float(most[1]) - finished.max_score * factor) > 1e-6 * max(1.0, float(most[1])):
            raise InputError(
                f"MaxPoints of {item!r} are {most[1]}, and full marks are {finished.max_score * factor:g}; give "
                f"--points {most[1]} to have them scaled",
                str(wanted.gradebook),
            )
        return name
    return f"{item} Points Grade"


def _text(name: str) -> str:
    return f"{_MARK}{name}"
