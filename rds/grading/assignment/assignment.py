"""An assignment: a folder with `assignment.toml` and the files that it names."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.toml_table import TomlTable
from rds.grading.assignment.assignment_file import ASSIGNMENT, READERS
from rds.grading.assignment.late_rules import LateRules, read_late_rules
from rds.grading.assignment.seeds import student_seed
from rds.grading.cases.case import Case
from rds.grading.cases.words import inside
from rds.grading.criteria.criterion import Criterion, read_criterion
from rds.grading.sandbox.limits import Limits

FILE = "assignment.toml"
_LEAST_SECRET = 8  # characters
COPY_SECRET = "hand-out: the plants of the grading are others"  # of the students' copy


@dataclass(frozen=True)
class Hidden:
    """What a hand-out leaves out: only how much of it there is."""

    criteria: int = 0
    points: float = 0.0


@dataclass(frozen=True)
class Assignment:
    """What submissions are graded by. `files` are the names that a submission's file may have, best first."""

    folder: Path
    title: str
    kind: str
    files: tuple[str, ...]
    due: datetime | None
    secret: str
    self_check: str
    feedback: str  # what a feedback page shows: what is visible, or what is hidden as well
    limits: Limits
    late: LateRules
    cases: tuple[Case, ...]
    criteria: tuple[Criterion, ...]
    solution: str | None
    template: str | None
    handout: str | None
    hidden: Hidden
    sha256: str  # of assignment.toml and all files that the grading depends on

    @property
    def max_score(self) -> float:
        """Points in all."""
        return float(f"{sum(criterion.max_score for criterion in self.criteria):.9g}")

    def seed(self, student: str) -> int:
        """Of a student's plants and noise."""
        return student_seed(self.secret, student)

    def case(self, name: str) -> Case:
        """The case called `name`."""
        return next(case for case in self.cases if case.name == name)

    def path(self, name: str | None) -> Path | None:
        """A file of the assignment."""
        return None if name is None else self.folder / name


def read_assignment(path: str | Path) -> Assignment:
    """The assignment in a folder (or of an `assignment.toml`).

    Raises InputError, with file, line, value and remedy, for anything that will not do; no word is ignored.
    """
    file = Path(path)
    file = file / FILE if file.is_dir() else file
    if not file.is_file():
        raise InputError(f"there is no {FILE}; name the assignment's folder", str(path))
    if file.suffix != ".toml":
        raise InputError(f"it is no assignment; name the folder with {FILE} first, then what is handed in", str(path))
    words, folder = TomlTable.open(file, ASSIGNMENT), file.parent
    kind = words.read("kind")
    machine = words.read("machine")
    cases = _cases(words, folder, kind, machine)
    criteria = _criteria(words, kind, cases)
    files = _files(words)
    names = {key: inside(words, key, folder) for key in ("solution", "template", "handout")}
    title = words.read("title", folder.resolve().name)
    made = Assignment(
        folder=folder,
        title=title or folder.resolve().name,
        kind=kind,
        files=files,
        due=_due(words),
        secret=_secret(words),
        self_check=words.read("self_check"),
        feedback=words.read("feedback"),
        limits=_limits(words.inner("limits")),
        late=read_late_rules(words.inner("late")),
        cases=tuple(cases.values()),
        criteria=criteria,
        hidden=_hidden(words.inner("hidden")),
        sha256=_sha256(folder, file, {name for case in cases.values() for name in case.files}),
        **names,
    )
    words.done()
    return made


def _cases(words: TomlTable, folder: Path, kind: str, machine: str) -> dict[str, Case]:
    tables = words.tables("case")
    if kind == "functions":
        if tables:
            raise InputError(
                "an assignment of functions has no cases; its criteria are unit-tests", words.place("case")
            )
        return {}
    read = import_module(READERS[kind]).read
    found: dict[str, Case] = {}
    for table in tables:
        case = read(table, folder, machine)
        if case.name in found:
            raise InputError(f"name = {case.name!r} is given to two cases", table.place("name"))
        found[case.name] = case
    return found


def _criteria(words: TomlTable, kind: str, cases: Mapping[str, Case]) -> tuple[Criterion, ...]:
    found: dict[str, Criterion] = {}
    for table in words.tables("criterion"):
        criterion = read_criterion(table, kind, cases)
        if criterion.name in found:
            raise InputError(f"name = {criterion.name!r} is given to two criteria", table.place("name"))
        found[criterion.name] = criterion
    if not found:
        raise InputError("it has no criterion; add [[criterion]] with name, kind, case, points, full, none", words.path)
    for table, criterion in zip(words.tables("criterion"), found.values(), strict=True):
        for name in criterion.requires:
            if name not in found:
                known = ", ".join(found)
                raise table.fault("requires", f"names {name!r}, which is no criterion; there are {known}")
    used = {name for criterion in found.values() for name in criterion.cases}
    for table, name in zip(words.tables("case"), cases, strict=True):
        if name not in used:
            raise InputError(f"case {name!r} is used by no criterion; remove it, or measure it", table.place("name"))
    return tuple(found.values())


def _files(words: TomlTable) -> tuple[str, ...]:
    given = words.any("files", ["submission.py"])
    if isinstance(given, str):
        given = [given]
    if not isinstance(given, list) or not given or not all(isinstance(name, str) and name for name in given):
        raise words.fault("files", 'must be a list of names, as in files = ["my_controller.py"]')
    for name in given:
        if Path(name).name != name or not name.endswith((".py", ".ipynb")):
            raise words.fault("files", f"holds {name!r}; each must be a .py or .ipynb file without a folder")
    return tuple(given)


def _due(words: TomlTable) -> datetime | None:
    given: Any = words.any("due")
    if isinstance(given, str):
        try:
            given = datetime.fromisoformat(given)
        except ValueError:
            raise words.fault("due", "is no time; as in due = 2026-11-30T23:59:00+01:00") from None
    if given is None:
        return None
    if not isinstance(given, datetime):
        raise words.fault("due", "must be a date with its time, as in 2026-11-30T23:59:00+01:00")
    if given.tzinfo is None:
        raise words.fault("due", "must say its time zone, as in 2026-11-30T23:59:00+01:00")
    return given


def _secret(words: TomlTable) -> str:
    secret = words.read("secret")
    if secret is None or len(secret) < _LEAST_SECRET:
        raise InputError(
            f"secret must be a text of {_LEAST_SECRET} characters or more that students do not know: their plants are "
            "drawn from it",
            words.place("secret"),
        )
    return str(secret)


def _limits(words: TomlTable | None) -> Limits:
    if words is None:
        return Limits()
    limits = Limits(**{field.name: words.read(field.name) for field in fields(Limits)})
    words.done()
    return limits


def _hidden(words: TomlTable | None) -> Hidden:
    if words is None:
        return Hidden()
    hidden = Hidden(words.read("criteria"), words.read("points"))
    words.done()
    return hidden


def _sha256(folder: Path, file: Path, names: set[str]) -> str:
    total = hashlib.sha256(file.read_bytes())
    for name in sorted(names):
        total.update(name.encode())
        total.update(hashlib.sha256((folder / name).read_bytes()).digest())
    return total.hexdigest()
