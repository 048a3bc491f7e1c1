"""Submissions that are alike: the same file, the same structure, the same closed loop; within a class and with others.

Others are what an instructor names: batches and submissions of earlier years, solutions that are public. Parsed in
other processes, which may crash, and run in the sandbox alone.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from rds.core.errors import InputError
from rds.core.parallel import Outcome, spread
from rds.core.parallel.reader_process import confine
from rds.core.parallel.scheduler import Scheduler
from rds.grading.assignment.assignment import Assignment
from rds.grading.batch.finished import CODE, STUDENTS
from rds.grading.batch.queue import MEMORY, Queued, queued
from rds.grading.batch.record import FILE as RECORD
from rds.grading.batch.similarity import (
    Fingerprints,
    Identical,
    Lines,
    Pair,
    Program,
    SameLoop,
    Uncompared,
    fingerprints_and_text,
    identical_files,
    same_loops,
    similar_pairs,
)
from rds.grading.batch.spool import Spool, Spooled
from rds.grading.batch.work import Task, graded, setup_of
from rds.grading.grade import AS_SOLUTION, BEHAVIOUR
from rds.grading.intake import collect

_PATIENCE = 600.0  # s for one file
_NOTHING = "Python cannot read it, or it is too short"  # of a program without a fingerprint


@dataclass(frozen=True)
class SimilarityReport:
    """What was found. Names of others are those of their folders: "2024/ada"."""

    pairs: list[Pair] = field(default_factory=list)
    identical: list[Identical] = field(default_factory=list)
    loops: list[SameLoop] = field(default_factory=list)
    uncompared: list[Uncompared] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Behaviour:
    """What is compared: a hash of all runs of a submission, empty without any; whether they are the solution's."""

    runs: bytes
    as_solution: bool = False

    @classmethod
    def of(cls, details: Mapping[str, Any]) -> Behaviour:
        """By the details of its grade."""
        by_case = details.get(BEHAVIOUR)
        told = json.dumps(by_case, sort_keys=True).encode() if by_case and isinstance(by_case, dict) else b""
        return cls(told and hashlib.sha256(told).digest(), bool(details.get(AS_SOLUTION)))


def earlier_files(assignment: Assignment, places: Sequence[Path]) -> dict[str, Spooled]:
    """Python by name, of all `places`: batches' folders, and folders or zips of submissions, or single files.

    A name begins with that of its place; with the whole path where several places are called alike.
    """
    found: dict[str, Spooled] = {}
    spool = Spool()
    called = [place.resolve().name for place in places]
    for place, name in zip(places, called, strict=True):
        whose = name if called.count(name) == 1 else str(place)
        if (place / RECORD).is_file():
            codes = sorted((place / STUDENTS).glob(f"*/{CODE}"))
            files = {path.parent.name: spool.put(path.read_bytes()) for path in codes}
        else:
            intake = collect(place, assignment.files, (assignment.title, assignment.folder.resolve().name))
            rows = queued(assignment, intake, place, 1)  # nothing is written there
            files = {each.row.student: each.code for each in rows if each.code is not None}
        if not files:
            raise InputError(
                "holds no submission to compare with; name a batch, or a folder of submissions", str(place)
            )
        found |= {f"{whose}/{student}": code for student, code in files.items()}
    return found


def alike(
    assignment: Assignment,
    rows: Sequence[Queued],
    behaviours: Mapping[str, Behaviour],
    against: Sequence[Path],
    jobs: int | None,
    scheduler: str | Scheduler | None = None,
) -> SimilarityReport:
    """All that is alike among `rows`, and between them and the files of `against`."""
    given = [(each.row.student, each.code) for each in rows if each.code is not None and each.code.size]
    spool = Spool()
    own = {
        name: spool.put((assignment.folder / name).read_bytes())
        for name in (assignment.template, assignment.solution)
        if name is not None
    }
    others = earlier_files(assignment, against)
    parsed = {name: code for name, code in own.items() if name.endswith(".py")}
    codes = [*parsed.values(), *(code for _, code in given), *others.values()]
    pairs: list[Pair] = []
    uncompared: list[Uncompared] = []
    if len(given) + len(others) > 1:  # else a process less to start, which is what one submission's time goes into
        done = spread(_prints, codes, jobs=jobs, retries=0, time_limit=_PATIENCE)
        sources = {name: prints for name, prints, _ in _read(parsed, done)}
        template = sources.pop(assignment.template or "", {})

        def found() -> Iterator[Program]:
            for student, prints, left_out in _read([student for student, _ in given], done):
                uncompared.extend([left_out] if left_out else [])
                yield student, prints

        theirs = ((name, prints) for name, prints, _ in _read(others, done))
        pairs = similar_pairs(found(), [template], sources, theirs)
    hashes = {each.row.student: each.sha256 for each in rows}
    sums = {name: hashlib.sha256(code.read()).hexdigest() for name, code in (own | others).items()}
    return SimilarityReport(
        pairs,
        identical_files({student: hashes[student] for student, _ in given}, sums),
        same_loops(
            {student: each.runs for student, each in behaviours.items()},
            _run(assignment, others, jobs, scheduler) | _solution(assignment, behaviours),
        ),
        uncompared,
    )


def _prints(code: Spooled) -> tuple[Fingerprints, tuple[Lines, ...]]:
    confine(MEMORY)
    return fingerprints_and_text(code.read())


def _read(names: Iterable[str], done: Iterator[Outcome]) -> Iterator[tuple[str, Fingerprints, Uncompared | None]]:
    """By name the fingerprints of the next of `done`, and what is not compared of it."""
    for name in names:
        outcome = next(done)
        prints, lines = outcome.value if outcome.ok else ({}, ())
        why = outcome.reason if not outcome.ok else "" if prints or lines else _NOTHING
        yield name, prints, Uncompared(name, lines, why) if lines or why else None


def _can_tell(assignment: Assignment) -> bool:
    """Whether a case is the same for everybody: only there the same law gives the same run."""
    return any(not case.is_drawn for case in assignment.cases)


def _solution(assignment: Assignment, behaviours: Mapping[str, Behaviour]) -> dict[str, bytes]:
    """What the solution does, where somebody does the same: whoever graded has compared."""
    same = [each.runs for each in behaviours.values() if each.as_solution]
    return {str(assignment.solution): same[0]} if same else {}


def _run(
    assignment: Assignment, codes: Mapping[str, Spooled], jobs: int | None, scheduler: str | Scheduler | None
) -> dict[str, bytes]:
    """What the files of others do, each in the sandbox as a submission would."""
    if not (codes and _can_tell(assignment)):
        return {}
    work = partial(graded, setup_of(assignment, jobs, shared=scheduler is None))
    tasks = [Task(name, code=code) for name, code in codes.items()]
    found: dict[str, bytes] = {}
    for outcome in spread(work, tasks, jobs=jobs, scheduler=scheduler, time_limit=_PATIENCE):
        if outcome.ok and not outcome.value.missing:
            found[tasks[outcome.index].student] = Behaviour.of(outcome.value.grade["details"]).runs
    return found
