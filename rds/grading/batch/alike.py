"""Submissions that are alike: the same file, the same structure, the same closed loop; within a class and with others.

Others are what an instructor names: batches and submissions of earlier years, solutions that are public. Parsed in
other processes, which may crash, and run in the sandbox alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from rds.core.errors import InputError
from rds.core.parallel import spread
from rds.core.parallel.scheduler import Scheduler
from rds.grading.assignment.assignment import Assignment
from rds.grading.batch.queue import Queued, queued
from rds.grading.batch.similarity import (
    Identical,
    Pair,
    SameLoop,
    fingerprints,
    identical_files,
    same_loops,
    similar_pairs,
)
from rds.grading.batch.work import AS_SOLUTION, BEHAVIOUR, CODE, Task, graded, setup_of
from rds.grading.grade import Grade
from rds.grading.intake import collect

_PATIENCE = 600.0  # s for one file
_RECORD, _STUDENTS = "batch.json", "students"


@dataclass(frozen=True)
class SimilarityReport:
    """What was found. Names of others are those of their folders: "2024/ada"."""

    pairs: list[Pair] = field(default_factory=list)
    identical: list[Identical] = field(default_factory=list)
    loops: list[SameLoop] = field(default_factory=list)


def earlier_files(assignment: Assignment, places: Sequence[Path]) -> dict[str, bytes]:
    """Python by name, of all `places`: batches' folders, and folders or zips of submissions, or single files."""
    found: dict[str, bytes] = {}
    for place in places:
        if (place / _RECORD).is_file():
            files = {path.parent.name: path.read_bytes() for path in sorted((place / _STUDENTS).glob(f"*/{CODE}"))}
        else:
            intake = collect(place, assignment.files, (assignment.title, assignment.folder.resolve().name))
            rows = queued(assignment, intake, place, 1)  # nothing is written there
            files = {each.row.student: each.code for each in rows if each.code is not None}
        if not files:
            raise InputError(
                "holds no submission to compare with; name a batch, or a folder of submissions", str(place)
            )
        for name, code in files.items():
            found[f"{place.resolve().name}/{name}"] = code
    return found


def alike(
    assignment: Assignment,
    rows: Sequence[Queued],
    grades: Mapping[str, Grade],
    against: Sequence[Path],
    jobs: int | None,
    scheduler: str | Scheduler | None = None,
) -> SimilarityReport:
    """All that is alike among `rows`, and between them and the files of `against`."""
    given = [(each.row.student, each.code) for each in rows if each.code]
    own = {
        name: (assignment.folder / name).read_bytes()
        for name in (assignment.template, assignment.solution)
        if name is not None
    }
    others = earlier_files(assignment, against)
    parsed = {name: code for name, code in own.items() if name.endswith(".py")}
    codes = [code for _, code in given] + list(parsed.values()) + list(others.values())
    if len(given) + len(others) < 2:  # no pair: a process less to start, which is what one submission's time goes into
        codes = []
    done = [outcome.value or {} for outcome in spread(fingerprints, codes, jobs=jobs, retries=0, time_limit=_PATIENCE)]
    found = {student: prints for (student, _), prints in zip(given, done, strict=False)}
    sources = dict(zip(parsed, done[len(given) :], strict=False))
    template = sources.pop(assignment.template or "", {})
    earlier = dict(zip(others, done[len(given) + len(parsed) :], strict=False))
    behaviours = {student: _behaviour(grade) for student, grade in grades.items()}
    return SimilarityReport(
        similar_pairs(found, [template], sources, earlier),
        identical_files(given, own | others),
        same_loops(behaviours, _run(assignment, others, jobs, scheduler) | _solution(assignment, grades)),
    )


def _can_tell(assignment: Assignment) -> bool:
    """Whether a case is the same for everybody: only there the same law gives the same run."""
    return any(not case.is_drawn for case in assignment.cases)


def _solution(assignment: Assignment, grades: Mapping[str, Grade]) -> dict[str, Mapping[str, str]]:
    """What the solution does, where somebody does the same: whoever graded has compared."""
    same = [_behaviour(grade) for grade in grades.values() if grade.details.get(AS_SOLUTION)]
    return {str(assignment.solution): same[0]} if same else {}


def _behaviour(grade: Grade) -> Mapping[str, str]:
    found = grade.details.get(BEHAVIOUR)
    return found if isinstance(found, dict) else {}


def _run(
    assignment: Assignment, codes: Mapping[str, bytes], jobs: int | None, scheduler: str | Scheduler | None
) -> dict[str, Mapping[str, str]]:
    """What the files of others do, each in the sandbox as a submission would."""
    if not (codes and _can_tell(assignment)):
        return {}
    work = partial(graded, setup_of(assignment, jobs, shared=scheduler is None))
    tasks = [Task(name, code=code) for name, code in codes.items()]
    found: dict[str, Mapping[str, str]] = {}
    for outcome in spread(work, tasks, jobs=jobs, scheduler=scheduler, time_limit=_PATIENCE):
        if outcome.ok and not outcome.value.missing:
            found[tasks[outcome.index].student] = _behaviour(Grade.from_json(outcome.value.grade))
    return found
