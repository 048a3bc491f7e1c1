"""`batch.json`: what a batch was begun with. What has changed since is told, and nothing is graded on top of it."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.installed import version as own_version
from rds.grading.assignment.assignment import Assignment
from rds.grading.grade import Status

FILE = "batch.json"
_FORMAT = 1


@dataclass(frozen=True)
class Record:
    """`versions` are of all that scores depend on; `handed_in` is by student the SHA-256 of the file, or the reason.

    `times` are when it was, as far as that is known; `layout` is how the submissions lay.
    """

    title: str
    folder: str
    assignment: str  # SHA-256
    versions: Mapping[str, str]
    handed_in: Mapping[str, str]
    times: Mapping[str, str]
    layout: str
    due: str | None
    late: Mapping[str, float] = field(default_factory=dict)  # the assignment's rules

    def write(self, folder: Path) -> None:
        """Into the batch's folder, whole."""
        text = json.dumps({"format": _FORMAT, **asdict(self)}, indent=1, sort_keys=True)
        write_whole(folder / FILE, text.encode() + b"\n")


def record_of(assignment: Assignment, handed_in: Mapping[str, str], times: Mapping[str, str], layout: str) -> Record:
    """What a batch that begins now is begun with."""
    from importlib.metadata import version

    versions = {"rds": own_version(), "Python": platform.python_version(), "numpy": version("numpy")}
    due = None if assignment.due is None else assignment.due.isoformat()
    folder = str(assignment.folder.resolve())
    return Record(
        assignment.title, folder, assignment.sha256, versions, handed_in, times, layout, due, assignment.late.to_table()
    )


def read_record(folder: Path) -> Record:
    """The record in a batch's folder; InputError if there is none, or it is of another kind."""
    path = folder / FILE
    try:
        data: Any = json.loads(path.read_bytes())
        if data.pop("format") != _FORMAT:
            raise ValueError
        return Record(**data)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}; is this the folder of a batch?", str(path)) from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(
            "is no record of a batch that this version knows; grade into a new folder", str(path)
        ) from error


def check_same(before: Record, now: Record, place: Path) -> None:
    """InputError that says what has changed so that scores could; new students and unreadable files do not count."""
    changes = []
    if before.assignment != now.assignment:
        changes.append("the assignment (assignment.toml, or a file that its cases read)")
    for name in sorted(before.versions.keys() | now.versions.keys()):
        was, is_now = before.versions.get(name, "missing"), now.versions.get(name, "missing")
        if was != is_now:
            changes.append(f"{name} ({was}, now {is_now})")
    gone = [student for student in before.handed_in if student not in now.handed_in]
    changes += _named("submissions gone", gone)
    kept = [student for student in before.handed_in if student in now.handed_in]
    readable = [s for s in kept if not before.handed_in[s].startswith(f"{Status.GRADER_ERROR}:")]
    changes += _named("submissions", [s for s in readable if before.handed_in[s] != now.handed_in[s]])
    changes += _named("times of submission", [s for s in readable if before.times.get(s) != now.times.get(s)])
    if changes:
        raise InputError(
            f"cannot be resumed, because these have changed since it was begun: {'; '.join(changes)}. Put back what "
            "was there, or grade all into a new folder",
            str(place),
        )


def _named(what: str, students: Sequence[str]) -> list[str]:
    more = f" and {len(students) - 5} more" if len(students) > 5 else ""
    return [f"{what} ({', '.join(students[:5])}{more})"] if students else []
