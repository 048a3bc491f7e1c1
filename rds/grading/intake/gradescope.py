"""What a Gradescope export says of its submissions: `submission_metadata.yml`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib import import_module
from typing import Any

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.grading.intake.items import Item, Refusal
from rds.grading.intake.names import shown

METADATA = "submission_metadata.yml"
_LARGEST = 64 << 20  # bytes; it holds all earlier results


@dataclass(frozen=True)
class Submitter:
    """Who handed a submission in, and when. A group is known by its first member; `source` names all."""

    student: str
    time: datetime | None
    source: dict[str, Any] = field(default_factory=dict)
    note: str = ""


def read_metadata(file: Item) -> dict[str, Submitter]:
    """Of each folder of an export its submitter. InputError if it is not what Gradescope writes, or cannot be read."""
    try:
        data = file.read(_LARGEST)
    except Refusal as error:
        raise InputError(f"cannot be read: {error}", METADATA) from error
    with needed_for("reading it", where=METADATA):
        yaml = import_module("yaml")  # which has no types of its own
    # texts, lists and mappings only: results of earlier graders hold whatever types Ruby has, and a number keeps its 0
    loader = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    try:
        whole = yaml.load(data, Loader=loader)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(f"is not YAML: {str(error).splitlines()[0]}; export it once more", METADATA) from error
    if not isinstance(whole, Mapping):
        raise InputError("is no table of submissions; export it once more", METADATA)
    return _apart({str(folder): _submitter(str(folder), about) for folder, about in whole.items()})


def _apart(found: dict[str, Submitter]) -> dict[str, Submitter]:
    """Whoever has the same number, but another e-mail address, is another student: users write their number themselves.

    Else the newer submission would be graded in the place of the other one's.
    """
    people: dict[str, set[str]] = {}
    for who in found.values():
        people.setdefault(who.student, set()).add(who.source["email"].casefold())
    return {
        folder: replace(
            who,
            student=f"{who.student} ({who.source['email'] or folder})",
            note=f"somebody else has the same student ID ({who.student})",
        )
        if len(people[who.student]) > 1
        else who
        for folder, who in found.items()
    }


def _submitter(folder: str, about: Any) -> Submitter:
    people = about.get(":submitters") if isinstance(about, Mapping) else None
    if not isinstance(people, list) or not people or not all(isinstance(each, Mapping) for each in people):
        raise InputError(f"{shown(folder)} has no :submitters; export it once more", METADATA)
    members = [{key: _text(each.get(f":{key}")) for key in ("name", "sid", "email")} for each in people]
    first = members[0]
    student = first["sid"] or first["email"] or first["name"] or folder
    source: dict[str, Any] = {**first, "submission": shown(folder)}
    if len(members) > 1:
        source["members"] = members
    return Submitter(student, _time(about.get(":created_at")), source)


def _text(value: Any) -> str:
    return "" if value in (None, "~", "null") else shown(str(value))


def _time(value: Any) -> datetime | None:
    """As in 2026-01-05 10:12:34.567890000 Z."""
    try:
        time = datetime.fromisoformat(re.sub(r"\s+(?=Z|[+-])", "", str(value)))
    except ValueError:
        return None
    return time if time.tzinfo else time.replace(tzinfo=UTC)
