"""One submission in a worker process, here or on another computer. Everything that scores depend on is in the order."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rds.core.errors import InputError
from rds.core.extras import needed_for
from rds.core.private_files import make_folder, write_private
from rds.grading.assignment.assignment import FILE, Assignment, read_assignment
from rds.grading.batch.finished import CODE, COLUMNS, FEEDBACK, python_name
from rds.grading.batch.grade_one import grade_with_runs
from rds.grading.batch.scratch import scratch
from rds.grading.batch.spool import Spooled
from rds.grading.batch.warm_worker import own_fault, shared_pool
from rds.grading.feedback.feedback import feedback_page
from rds.grading.grade import AS_SOLUTION, BEHAVIOUR
from rds.grading.sandbox.submission import safe_name
from rds.results.arrow import repeated, to_arrow

if TYPE_CHECKING:
    from rds.grading.cases.case import CaseRun

_ANSWERS = ("_command", "_voltage", "_modelled")  # columns of what a submission answers
_SOLUTION = "reference solution"  # the student whose plants it runs on


@dataclass(frozen=True)
class Setup:
    """What all submissions of a batch share: the assignment's folder, or its files where no folder is shared."""

    sha256: str  # of the assignment
    folder: str = ""
    files: tuple[tuple[str, bytes], ...] = ()
    jobs: int | None = None  # at the same time on this computer; None where nobody knows


@dataclass(frozen=True, slots=True)
class Task:
    """One submission as Python: at `path`, or its `code` where no folder is shared. The rest goes into its grade."""

    student: str
    path: str = ""
    code: Spooled | None = None
    time: datetime | None = None
    notes: tuple[str, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Answer:
    """A grade in JSON's types, and files to be kept beside it. `missing` says why this computer cannot grade."""

    grade: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    seconds: float = 0.0  # that it took: of no score's concern
    missing: str = ""


def setup_of(assignment: Assignment, jobs: int | None, shared: bool) -> Setup:
    """The assignment for workers, which see its folder if `shared`."""
    if shared:
        return Setup(assignment.sha256, str(assignment.folder.resolve()), jobs=jobs)
    own = (assignment.solution, assignment.template, assignment.handout)
    names = {FILE, *(name for name in own if name), *(name for case in assignment.cases for name in case.files)}
    files = tuple((name, (assignment.folder / name).read_bytes()) for name in sorted(names))
    return Setup(assignment.sha256, files=files, jobs=jobs)


def graded(setup: Setup, task: Task) -> Answer:
    """The grade of a task. An exception is ours, and no fault of the submission."""
    if not setup.folder and (fault := own_fault()):  # on this computer the walls were tried before any work began
        return Answer(missing=fault)
    pool = shared_pool(setup.jobs)  # it starts while the assignment is read
    assignment, solution = _assignment(setup)
    began = time.monotonic()
    with scratch("submission") as folder:
        path = folder / safe_name(python_name(task.about))
        assert task.path or task.code is not None  # the code comes with the task where no folder is shared
        code = Path(task.path).read_bytes() if task.code is None else task.code.read()
        write_private(path, code, is_own=True)
        found = grade_with_runs(assignment, path, task.student, pool, submitted=task.time)
    grade, seconds = found.grade, time.monotonic() - began
    expected = _expected(setup) if solution else ()
    own = behaviour(assignment, found.runs)
    about = {**grade.details, BEHAVIOUR: own, **task.about}
    if own and own == behaviour(assignment, expected):
        about[AS_SOLUTION] = True
    grade = replace(grade, notes=(*task.notes, *grade.notes), details=about)
    page = feedback_page(assignment, grade, found.runs, expected)
    files = {FEEDBACK: page.encode("utf-8", "replace")}
    if found.runs:
        files[COLUMNS] = columns_of(found.runs)
    return Answer(grade.to_json(), files, seconds)


def behaviour(assignment: Assignment, runs: Sequence[CaseRun]) -> dict[str, str]:
    """By case a hash of what the submission answered, where the case is the same for everybody and it did something."""
    same = {case.name for case in assignment.cases if not case.is_drawn}
    made: dict[str, str] = {}
    for run in runs:
        if run.case not in same or run.fault:
            continue
        answers = [run.result[name] for name in run.result.columns if name.endswith(_ANSWERS)]
        answers = answers if run.rows is None else [run.rows]
        if any(np.any(values != values.flat[0]) for values in answers if values.size):
            made[run.case] = hashlib.sha256(b"".join(np.ascontiguousarray(v).tobytes() for v in answers)).hexdigest()
    return made


def columns_of(runs: tuple[CaseRun, ...]) -> bytes:
    """All runs as one Parquet table: case, run, and the columns of each; null where a run has no such column."""
    with needed_for("a batch"):
        import pyarrow as pa
        import pyarrow.parquet as pq

    tables = []
    for run in runs:
        count = len(run.result)
        about = {"case": repeated(run.case, count), "run": to_arrow(np.full(count, run.number, np.int32))}
        tables.append(pa.table(about | {name: to_arrow(values) for name, values in run.result.columns.items()}))
    whole = pa.concat_tables(tables, promote_options="permissive").unify_dictionaries()
    floats = [field.name for field in whole.schema if pa.types.is_floating(field.type)]
    sink = pa.BufferOutputStream()
    # the bytes of floats split by their place: a third of the size, in less time
    pq.write_table(
        whole, sink, compression="zstd", compression_level=1, use_dictionary=["case"], use_byte_stream_split=floats
    )
    data: bytes = sink.getvalue().to_pybytes()
    return data


@lru_cache(maxsize=1)
def _assignment(setup: Setup) -> tuple[Assignment, bytes]:
    """Read once for each worker, with the reference solution if there is one."""
    if setup.folder:
        read, code = _with_solution(setup.folder)
    else:
        with scratch("assignment") as own:
            for name, data in setup.files:
                path = own / name
                make_folder(path.parent)
                write_private(path, data, is_own=True)
            read, code = _with_solution(own)
    if read.sha256 != setup.sha256:
        raise InputError("the assignment's files were changed while it was graded; put them back and resume")
    return read, code


def _with_solution(folder: str | Path) -> tuple[Assignment, bytes]:
    read = read_assignment(folder)
    solution = read.path(read.solution)
    return read, b"" if solution is None else solution.read_bytes()


@lru_cache(maxsize=1)
def _expected(setup: Setup) -> tuple[CaseRun, ...]:
    """The runs of the reference solution, once for each worker."""
    assignment, code = _assignment(setup)
    with scratch("solution") as folder:
        path = folder / CODE
        write_private(path, code, is_own=True)
        return grade_with_runs(assignment, path, _SOLUTION, shared_pool(setup.jobs)).runs
