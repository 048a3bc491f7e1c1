"""The students' copy of an assignment: what is visible, and how much is hidden."""

from __future__ import annotations

import secrets
import shutil
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.private_files import make_folder, write_private
from rds.core.toml_file import read_toml
from rds.core.toml_text import toml_text
from rds.grading.assignment.assignment import COPY_SECRET, FILE, Assignment, read_assignment

_COMMENT = """The students' copy of an assignment: visible cases and criteria only.
Try your file with: rds grade self FOLDER FILE"""


def hand_out(assignment: Assignment, out: Path) -> list[Path]:
    """Write the copy to the folder `out`, whole or not at all; its files. InputError where `out` is not empty."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError("is there already; name a new folder, or empty it", str(out))
    for fault in promised(assignment):
        raise InputError(fault, str(assignment.folder / FILE))
    staged = out.with_name(f".{out.name}.{secrets.token_hex(6)}.part")
    try:
        make_folder(staged)
        write_private(staged / FILE, toml_text(_table(assignment), _COMMENT).encode())
        for name in _files(assignment):
            target = staged / name
            make_folder(target.parent)
            write_private(target, (assignment.folder / name).read_bytes())
        read_assignment(staged)  # it is an assignment itself, or something here is wrong
        if out.exists():
            out.rmdir()
        staged.replace(out)
    except OSError as error:
        raise InputError(f"cannot write: {error.strerror or error}; choose another place", str(out)) from error
    finally:
        shutil.rmtree(staged, ignore_errors=True)
    return sorted(path for path in out.rglob("*") if path.is_file())


def promised(assignment: Assignment) -> list[str]:
    """Faults: visible criteria whose points a criterion takes that students cannot see."""
    shown = _shown(assignment)
    return [
        f"{each.title}: it is visible, but requires {', '.join(gates)}, which students cannot see: the hand-out would "
        "promise points that are then taken; require a visible criterion, or hide this one"
        for each in assignment.criteria
        if each.name in shown and (gates := [name for name in each.requires if name not in shown])
    ]


def _files(assignment: Assignment) -> list[str]:
    shown = _shown(assignment)
    cases = {name for criterion in shown for name in _criterion(assignment, criterion).cases}
    files = {file for case in assignment.cases if case.name in cases for file in case.files}
    return sorted(files | {name for name in (assignment.handout, assignment.template) if name is not None})


def _shown(assignment: Assignment) -> list[str]:
    """The criteria that students can try: visible, on visible cases only."""
    visible = {case.name for case in assignment.cases if case.is_visible}
    return [each.name for each in assignment.criteria if each.is_visible and set(each.cases) <= visible]


def _criterion(assignment: Assignment, name: str) -> Any:
    return next(criterion for criterion in assignment.criteria if criterion.name == name)


def _table(assignment: Assignment) -> dict[str, Any]:
    shown = _shown(assignment)
    if not shown:
        raise InputError(
            "no criterion can be shown: each is hidden, or measured on a hidden case; make one visible",
            str(assignment.folder),
        )
    table: dict[str, Any] = _plain(read_toml(assignment.folder / FILE)[0])
    cases = {case for name in shown for case in _criterion(assignment, name).cases}
    table.pop("solution", None)
    hidden = [criterion for criterion in assignment.criteria if criterion.name not in shown]
    criteria = []
    for entry in table["criterion"]:
        if entry["name"] in shown:
            criterion = _criterion(assignment, entry["name"])
            if criterion.cases:  # those of all cases would be others without the hidden ones
                entry.pop("case", None)
                entry["cases"] = list(criterion.cases)
            if "requires" in entry:
                entry["requires"] = list(criterion.requires)
            criteria.append(entry)
    table |= {"secret": COPY_SECRET, "self_check": "visible"}
    if hidden or assignment.hidden.criteria:
        points = sum(criterion.max_score for criterion in hidden) + assignment.hidden.points
        table["hidden"] = {"criteria": len(hidden) + assignment.hidden.criteria, "points": points}
    if "case" in table:
        table["case"] = [case for case in table["case"] if case["name"] in cases]
    return table | {"criterion": criteria}


def _plain(value: Any) -> Any:
    """Dates as texts: TOML is written from texts and numbers."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    return value.isoformat() if isinstance(value, datetime | date | time) else value
