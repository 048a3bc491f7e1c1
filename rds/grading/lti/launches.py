"""Who came from the platform, and where the points of each go: one line for each launch, the last one counts."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.grading.batch.journal import Journal, read_journal
from rds.grading.intake.layouts import TIMES
from rds.grading.intake.names import safe_id
from rds.grading.lti.registration import LAUNCHES
from rds.grading.table_text import rows_by_heading

_ENDINGS = (".py", ".ipynb")


@dataclass(frozen=True)
class Launched:
    """A student as the platform named them: `student` is the folder of the submission, `user` the platform's `sub`."""

    student: str
    user: str
    name: str = ""
    email: str = ""
    lineitem: str = ""  # where points go; empty where the platform offers none
    scopes: tuple[str, ...] = ()


def student_of(user: str, email: str) -> str:
    """A folder's name for a person: the e-mail address where the platform tells it, else its own identifier."""
    return safe_id((email or user).strip().casefold())


def read_launches(folder: Path) -> dict[str, Launched]:
    """By student the last launch in the folder of the registration."""
    found: dict[str, Launched] = {}
    for row in read_journal(folder / LAUNCHES):
        try:
            found[row["student"]] = Launched(**{**row, "scopes": tuple(row["scopes"])})
        except (TypeError, KeyError) as error:
            raise InputError(
                f"is no list of launches that this version knows ({error})", str(folder / LAUNCHES)
            ) from error
    return found


def keep_launch(folder: Path, launched: Launched) -> None:
    """Add a launch, on the disk when this returns."""
    with Journal(folder / LAUNCHES) as journal:
        journal.append(asdict(launched) | {"scopes": list(launched.scopes)})


def keep_submission(place: Path, launched: Launched, name: str, data: bytes) -> Path:
    """Write what a student handed in, with its time, into the folder of submissions; a later one takes its place.

    InputError for a name that is neither Python nor a notebook.
    """
    ending = next((each for each in _ENDINGS if name.lower().endswith(each)), "")
    if not ending:
        raise InputError(f"{name!r} is neither a .py file nor an .ipynb notebook; hand in one of these")
    path = write_whole(place / launched.student / f"submission{ending}", data)
    for other in _ENDINGS:
        if other != ending:
            path.with_suffix(other).unlink(missing_ok=True)
    _stamp(place / TIMES, launched.student)
    return path


def _stamp(path: Path, student: str) -> None:
    rows: dict[str, str] = {}
    if path.is_file():
        reader = rows_by_heading(path.read_text(encoding="utf-8-sig"), str(path))
        rows = {row["student"]: row["timestamp"] for row in reader}
    rows[student] = datetime.now(UTC).isoformat(timespec="seconds")
    stream = io.StringIO()
    csv.writer(stream).writerows([("student", "timestamp"), *sorted(rows.items())])
    write_whole(path, stream.getvalue().encode())
