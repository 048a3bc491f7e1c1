"""Of several attempts of one student the newest, where the platform says which that is."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from rds.grading.intake.items import Item, Refusal
from rds.grading.intake.names import shown

_VERSION = re.compile(r"Version (\d{1,6})")  # the folder that Teams makes for each time of handing in

_DATED = re.compile(r"\d{4}(?:-\d\d){5}")  # the one that VPL makes


def is_dated(folder: str) -> bool:
    """Whether a folder is one attempt in VPL, called by its time."""
    return bool(_DATED.fullmatch(folder))


def dashed_time(said: str) -> datetime | None:
    """As in "2026-01-09-10-00-00"; None for what is no time."""
    try:
        return datetime.strptime(said, "%Y-%m-%d-%H-%M-%S")
    except ValueError:
        return None


def is_version(folder: str) -> bool:
    """Whether a folder is one attempt in Teams."""
    return bool(_VERSION.fullmatch(folder))


def of_newest(items: Sequence[Item], notes: list[str]) -> list[Item]:
    """The files of the newest attempt that holds a submission, with a note on the others.

    Refusal if it cannot be told which is the newest.
    """
    every = _by_attempt(items)
    by_attempt = {each: files for each, files in every.items() if any(item.is_handed_in for item in files)}
    if empty := [shown(name) for name, _ in every if name and name not in {attempt[0] for attempt in by_attempt}]:
        notes.append(
            f"there is no .py, .ipynb or .zip in the attempt {', '.join(empty[-5:])}, and so it does not count"
        )
    if len(by_attempt) < 2:
        return list(items)
    names = sorted(shown(name) for name, _ in by_attempt)
    orders = {order for _, order in by_attempt}
    if None in orders or len(orders) < len(by_attempt):
        raise Refusal(f"there are {len(names)} attempts ({'; '.join(names[:5])}), and none says that it is the newest")
    newest = max(by_attempt, key=lambda attempt: attempt[1])
    others = [shown(name) for name, order in sorted(by_attempt, key=lambda attempt: attempt[1]) if order != newest[1]]
    notes.append(
        f"of {len(names)} attempts the newest is graded ({shown(newest[0])}), and not {', '.join(others[-5:])}"
    )
    return by_attempt[newest]


def _by_attempt(items: Sequence[Item]) -> dict[tuple[str, Any], list[Item]]:
    """The files by name and order of their attempt."""
    found: dict[tuple[str, Any], list[Item]] = {}
    handed_in = [item for item in items if item.is_handed_in]
    if all(item.attempt for item in handed_in):
        for item in items:
            found.setdefault((item.attempt, _with_zone(item.time)), []).append(item)
    elif (at := _version_at(handed_in)) is not None:
        for item in items:
            match = _VERSION.fullmatch(item.parts[at]) if len(item.parts) > at else None
            if match:
                found.setdefault((match[0], int(match[1])), []).append(item)
    return found


def _version_at(items: Sequence[Item]) -> int | None:
    """Where in the paths the folders of Teams stand: all files lie in them, side by side."""
    at = 0
    while items and all(len(item.parts) > at + 1 for item in items):
        if all(is_version(item.parts[at]) for item in items):
            return at
        if len({item.parts[at] for item in items}) > 1:
            return None
        at += 1
    return None


def _with_zone(when: datetime | None) -> datetime | None:
    """To be compared: those of one platform all say a zone, or none does."""
    return when if when is None or when.tzinfo else when.replace(tzinfo=UTC)
