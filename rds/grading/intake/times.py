"""When something was handed in, as far as anybody who is to be believed says so."""

from __future__ import annotations

import unicodedata
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from zoneinfo import ZoneInfo

from rds.core.errors import InputError
from rds.grading.intake.items import Refusal
from rds.grading.intake.layouts import NOT_UNDERSTOOD, TIMES, Layout, StudentFiles
from rds.grading.intake.nbgrader import STAMP
from rds.grading.table_text import rows_by_heading

_LARGEST = 4 << 20  # bytes
# Hours of those that mean one zone only (CST, IST and BST are several) and are no names of the time zone database.
_ABBREVIATIONS = {"AKDT": -8, "AKST": -9, "PDT": -7, "PST": -8, "MDT": -6, "CDT": -5, "EDT": -4}
_ABBREVIATIONS |= {"WEST": 1, "CEST": 2, "EEST": 3, "MSK": 3, "JST": 9, "KST": 9, "AEST": 10, "AEDT": 11}


def listed_times(layout: Layout, zone: tzinfo | None) -> dict[str, datetime]:
    """Of each student the time in the instructor's `timestamps.csv`: columns student and timestamp (ISO 8601).

    A time without a zone is one of `zone`. InputError, with the line, for what is no such table, or names nobody.
    """
    if layout.times is None:
        return {}
    try:
        text = layout.times.read(_LARGEST).decode("utf-8-sig")
    except (Refusal, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read: {error}; save it as UTF-8", TIMES) from error
    reader = rows_by_heading(text, TIMES)
    if not {"student", "timestamp"} <= set(reader.fieldnames or ()):
        raise InputError("must have the columns student and timestamp, with a comma between them", f"{TIMES}: line 1")
    known, found = {handed.student for handed in layout.by_student}, {}
    composed = {unicodedata.normalize("NFC", student): student for student in known}
    for row in reader:
        place, told = f"{TIMES}: line {reader.line_num}", (row["student"] or "").strip()
        # a Mac keeps accents apart from their letters in the names of files
        student = told if told in known else composed.get(unicodedata.normalize("NFC", told), told)
        if student not in known:
            raise InputError(f"student {student!r} handed nothing in; correct the name, or remove the line", place)
        if student in found:
            raise InputError(f"student {student!r} has a line above already; keep one of them", place)
        try:
            when = datetime.fromisoformat((row["timestamp"] or "").strip())
            when.astimezone(UTC)
        except (ValueError, OverflowError):
            said = row["timestamp"]
            raise InputError(f"timestamp = {said!r} is no time; as in 2026-11-30T23:59:00+01:00", place) from None
        found[student] = when if when.tzinfo else when.replace(tzinfo=zone or UTC)
    return found


def stamped_time(handed: StudentFiles) -> datetime | None:
    """nbgrader's own `timestamp.txt`: date and time, and the zone. None, with a note, if it cannot be understood."""
    if handed.stamp is None:
        return None
    text = ""
    try:
        text = handed.stamp.read(_LARGEST).decode().strip()
        when = _nbgrader_time(text)
        when = when if when.tzinfo else when.replace(tzinfo=UTC)
        when.astimezone(UTC)  # a gradebook has it so; OverflowError at the ends of the calendar
        return when
    except (Refusal, UnicodeDecodeError, ValueError, KeyError, OSError, OverflowError):
        handed.notes.append(f"{NOT_UNDERSTOOD} ({text[:60]!r} in its {STAMP}), and so is taken for nothing")
        return None


def _nbgrader_time(text: str) -> datetime:
    """A time of ISO 8601, or one with its zone behind: the name, or the abbreviation that %Z of Python gives."""
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        moment, zone = text.rsplit(maxsplit=1)
        if zone[0] in "+-":
            return datetime.fromisoformat(moment + zone)
        hours = _ABBREVIATIONS.get(zone)
        known = ZoneInfo(zone) if hours is None else timezone(timedelta(hours=hours))
        return datetime.fromisoformat(moment).replace(tzinfo=known)


def with_zone(when: datetime | None, zone: tzinfo | None) -> datetime | None:
    """A time that says no zone is one of `zone`; of this computer's if that is None too."""
    if when is None or when.tzinfo is not None:
        return when
    return when.replace(tzinfo=zone) if zone else when.astimezone()
