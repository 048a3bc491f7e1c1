"""Which of a student's files is graded: one by name, the newest of several, or none with the reason."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from hashlib import sha256

from rds.grading.intake.archives import files_in_own
from rds.grading.intake.attempts import of_newest
from rds.grading.intake.items import Item, Refusal, refusal
from rds.grading.intake.layouts import StudentFiles
from rds.grading.intake.names import shown, without_number
from rds.grading.intake.notebooks import LARGEST

_MOST_COPIES = 20  # files that are compared
_BEFORE_ALL = datetime.min.replace(tzinfo=UTC)


class NothingToGrade(Exception):
    """There is no file to grade: the reason."""


def chosen(handed: StudentFiles, accepted: Sequence[str]) -> Item:
    """The file of `handed` to grade: of a name in `accepted`, best first; else the only one there is.

    Nothing if there is none; Refusal if what there is may not be opened, or it cannot be told which one is meant.
    """
    files = _with_unpacked(of_newest(handed.items, handed.notes))
    if not files:
        raise NothingToGrade("nothing was handed in")
    candidates = [item for item in files if item.is_code]
    if not candidates:
        if bad := next((item for item in files if item.fault), None):
            raise refusal(bad.fault, bad.is_unreadable)
        names = ", ".join(sorted(shown(item.name) for item in files)[:5])
        raise NothingToGrade(f"there is no .py or .ipynb file in what was handed in ({names})")
    outermost = min(len(item.parts) for item in candidates)
    named = [item for item in candidates if without_number(item.name, accepted)[0] in accepted]
    among = named or [item for item in candidates if len(item.parts) == outermost]
    keys = {id(item): _rank(item, handed, accepted) for item in among}
    best = max(keys.values())
    found = [item for item in among if keys[id(item)] == best]
    if len(found) > 1 and not _are_copies(found):
        names = ", ".join(sorted(shown("/".join(item.parts)) for item in found)[:5])
        raise Refusal(f"{len(found)} files could be meant ({names}); hand in one")
    if named:  # ILIAS puts words in front of the name of what is late, and people in front of copies
        ends = tuple(accepted)
        among = [item for item in candidates if without_number(item.name, accepted)[0].endswith(ends)]
    if len(among) > 1:
        others = ", ".join(sorted(shown("/".join(item.parts)) for item in among if item is not found[0])[:5])
        handed.notes.append(f"{shown('/'.join(found[0].parts))} is graded, and not {others}")
    if found[0].fault:
        raise refusal(found[0].fault, found[0].is_unreadable)
    return found[0]


def _with_unpacked(items: Sequence[Item]) -> list[Item]:
    """The files, and those in zips if there is no code beside these."""
    if any(item.is_code for item in items):
        return [item for item in items if not item.is_archive]
    files = [item for item in items if not item.is_archive]
    for item in items:
        if item.is_archive:
            files += [item] if item.fault else files_in_own(item)
    return files


def _are_copies(items: Sequence[Item]) -> bool:
    """Whether it does not matter which of them is meant."""
    try:
        return len(items) <= _MOST_COPIES and len({sha256(item.read(LARGEST)).digest() for item in items}) == 1
    except Refusal:
        return False


def _rank(item: Item, handed: StudentFiles, accepted: Sequence[str]) -> tuple[datetime, int, int, int]:
    """Newer first; then the number of the attempt; then the better name; then what lies in fewer folders."""
    name, number = without_number(item.name, accepted)
    when = item.time if handed.has_times and item.time is not None else _BEFORE_ALL
    place = accepted.index(name) if name in accepted else len(accepted)
    return when if when.tzinfo else when.replace(tzinfo=UTC), number, -place, -len(item.parts)
