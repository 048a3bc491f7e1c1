"""A batch from beginning to end, or from where it was ended."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rds.core.atomic import write_files, write_whole
from rds.core.errors import InputError
from rds.core.parallel import Outcome, Scheduler, processors, spread
from rds.core.parallel.process import WorkerProcess
from rds.core.progress import Progress
from rds.grading.assignment.assignment import COPY_SECRET, Assignment, read_assignment
from rds.grading.assignment.assignment import FILE as ASSIGNMENT
from rds.grading.assignment.late_rules import LateRules
from rds.grading.batch.alike import Behaviour, alike
from rds.grading.batch.finished import CODE, FEEDBACK
from rds.grading.batch.journal import FILE as JOURNAL
from rds.grading.batch.journal import Journal
from rds.grading.batch.outcome import BatchOutcome
from rds.grading.batch.queue import Queued, keep, queued, ungraded
from rds.grading.batch.record import FILE, check_same, read_record, record_of
from rds.grading.batch.similarity_table import alike_json
from rds.grading.batch.warm_worker import fault_of
from rds.grading.batch.work import Answer, Task, graded, setup_of
from rds.grading.course.class_list import FILE as CLASS
from rds.grading.course.class_list import ClassList, read_class_list
from rds.grading.course.groups import by_group, with_groups_of_export
from rds.grading.feedback.feedback import feedback_page
from rds.grading.grade import Grade, Status
from rds.grading.intake import Intake, collect
from rds.grading.intake.layouts import NOT_UNDERSTOOD
from rds.grading.review.publish import SIMILARITY, publish
from rds.grading.sandbox import available

STUDENTS = "students"
_PATIENCE = 600.0  # s for one submission beyond all that it may take: then it is the grader that hangs
Address = str | Scheduler | None
_LONGEST = 2.0 * (1.0 + 10.0)  # times the limits: where all is visible and where it is hidden, run and counted


@dataclass(frozen=True)
class BatchOptions:
    """How a batch is graded, whatever it is. `announce` gets sentences for whoever watches."""

    jobs: int | None = None  # local processes; default: one for each processor
    scheduler: Address = None  # a dask cluster, whose workers grade
    resume: bool = False
    class_list: Path | None = None
    against: tuple[Path, ...] = ()  # what submissions are compared with, besides each other
    progress: Progress | None = None
    announce: Callable[[str], None] = lambda text: None
    first: WorkerProcess | None = None  # a local worker that was begun ahead, see `warm_worker`


def run_batch(assignment: str | Path, submissions: str | Path, out: str | Path, **how: Any) -> BatchOutcome:
    """Grade all `submissions` (a folder or an exported zip) by the assignment in a folder, into the folder `out`.

    `how` are the fields of `BatchOptions`. Each finished submission is in the journal of `out` before the next is:
    `resume` goes on after a kill at any point, with the same scores. What a submission does is in its row.
    Raises InputError for what will not do, with nothing graded; also where the sandbox does not hold.
    """
    read = read_assignment(assignment)
    _check_place(Path(submissions), Path(out))
    names = (read.title, read.folder.resolve().name)
    zone = read.due.tzinfo if read.due else None
    return grade_all(read, lambda: collect(submissions, read.files, names, zone), Path(out), BatchOptions(**how))


def grade_all(read: Assignment, handed_in: Callable[[], Intake], out: Path, how: BatchOptions) -> BatchOutcome:
    """As `run_batch`, whatever was handed in comes from; it is asked for when all else is known to be in order."""
    began = time.monotonic()
    if read.secret == COPY_SECRET:
        raise InputError(
            "is the students' copy of an assignment, without its hidden criteria and its secret: name the folder that "
            "`rds grade hand-out` made it of",
            str(read.folder),
        )
    _check_free(out, how.resume)
    kept = out / CLASS
    place = how.class_list or (kept if kept.exists() else None)
    listed = ClassList() if place is None else read_class_list(place)
    _check_sandbox(how)
    given = listed
    intake, listed = with_groups_of_export(handed_in(), given)
    intake = by_group(intake, listed)
    rows = queued(read, intake, out / STUDENTS, how.jobs if how.scheduler is None else None)
    record = record_of(
        read,
        {each.row.student: each.mark for each in rows},
        {each.row.student: each.row.time.isoformat() for each in rows if each.row.time},
        intake.layout,
    )
    notes = [f"not a submission, and left alone: {name}" for name in intake.ignored]
    notes += _unlisted(listed, intake)
    notes += _untimed(read, intake)
    with Journal(out / JOURNAL, _known) as journal:  # from here on nobody else writes into this folder
        if (out / FILE).exists():
            _check_free(out, how.resume)
            check_same(read_record(out), record, out)
        record.write(out)
        if listed.members and (how.class_list is not None or listed != given):
            write_whole(kept, listed.to_csv())
        if journal.was_torn:
            how.announce(
                "the last line of the journal was only half written, and was cut off: that submission is graded again"
            )
        keep(rows)
        batch = _Batch(read, rows, journal, how)
        todo = batch.todo()
        if len(todo) < len(rows):
            how.announce(f"{len(rows) - len(todo)} of {len(rows)} submissions are graded already")
        batch.go(todo)
        found = alike(read, rows, batch.behaviours(), how.against, how.jobs, how.scheduler)
        write_whole(out / SIMILARITY, alike_json(found.pairs, found.identical, found.loops, found.uncompared))
        count = len(todo)
        del batch, todo, rows, intake, record, found  # or a class would be in memory twice
        grades = publish(out, read).measured
    return BatchOutcome(out, grades, count, time.monotonic() - began, tuple(notes))


def _unlisted(listed: ClassList, intake: Intake) -> list[str]:
    """Who handed in, and is not in the class list."""
    if not listed.members:
        return []
    groups = listed.groups()
    strangers = [r.student for r in intake.rows if r.student not in groups and listed.find(r.student, r.source) is None]
    people = [each for row in intake.rows for each in row.source.get("members", ())]  # of groups in Gradescope
    strangers += [
        who for each in people if listed.find(who := each["sid"] or each["email"] or each["name"], each) is None
    ]
    return [f"not in the class list: {student}" for student in dict.fromkeys(strangers)]


def _untimed(assignment: Assignment, intake: Intake) -> list[str]:
    """That lateness costs points, and that nobody knows when some have handed in."""
    if assignment.due is None or assignment.late == LateRules():
        return []
    handed_in = [row for row in intake.rows if row.status is not Status.MISSING]
    count, notes = sum(row.time is None for row in handed_in), []
    if count:
        notes.append(
            f"when they handed in is not known of {count} of {len(handed_in)} submissions, so nothing is deducted for "
            "lateness there; timestamps.csv (student,timestamp) at the top of the submissions says it"
        )
    for row in intake.rows:
        unread = [note for note in row.notes if row.time is None and note.startswith(NOT_UNDERSTOOD)]
        notes.extend(f"{row.student}: {note}" for note in unread)
    return notes


def _check_sandbox(how: BatchOptions) -> None:
    """InputError where submissions cannot be run, before anything is written."""
    if how.scheduler is None:
        if fault := available() if how.first is None else fault_of(how.first):
            raise InputError(fault)
        return
    for outcome in spread(_missing, [0], jobs=how.jobs, scheduler=how.scheduler):
        if not outcome.ok:
            raise InputError(f"scheduler {how.scheduler!r}: a worker cannot grade: {outcome.reason}; install rds there")
        _answer(outcome)


def _missing(_: int) -> Answer:
    """On a worker: whether it can grade."""
    return Answer(missing=available() or "")


def _check_place(submissions: Path, out: Path) -> None:
    """InputError where a batch or an assignment would be taken for students' submissions, now or the next time."""
    for file, what in ((FILE, "the grades of a batch"), (ASSIGNMENT, "an assignment")):
        if (submissions / file).is_file():
            raise InputError(f"holds {what}; name the folder of what students handed in", str(submissions))
    if submissions.is_dir() and out.resolve().is_relative_to(submissions.resolve()):
        said = "is inside the submissions, where it would be taken for a student's; name a folder beside them"
        raise InputError(said, str(out))


def _check_free(out: Path, resume: bool) -> None:
    """InputError where `out` is in use for something else."""
    if not out.exists() or (resume and (out / FILE).exists()):
        return
    if not out.is_dir():
        raise InputError("is not a folder; name another place", str(out))
    if (out / FILE).exists():
        raise InputError("holds a batch already; go on with it by --resume, or name a new folder", str(out))
    if any(not path.name.startswith(".") and not _is_empty_journal(path) for path in out.iterdir()):
        raise InputError("is not empty, and holds no batch; name a new folder", str(out))


def _is_empty_journal(path: Path) -> bool:
    """What is left of a batch that was ended before it had begun."""
    return path.name == JOURNAL and path.is_file() and path.stat().st_size == 0


@dataclass(frozen=True, slots=True)
class _Done:
    """What has to be known of a grade until all are made: the rest is on the disk, so that any class has room."""

    status: Status
    behaviour: Behaviour

    @classmethod
    def of(cls, grade: Mapping[str, Any]) -> _Done:
        """By the grade as the journal has it."""
        return cls(Status(grade["status"]), Behaviour.of(grade["details"]))


class _Batch:
    """Rows, and what the journal says of them."""

    def __init__(self, assignment: Assignment, rows: Sequence[Queued], journal: Journal, how: BatchOptions):
        self._assignment, self._journal, self._how = assignment, journal, how
        self._rows = {each.row.student: each for each in rows}
        self._done: dict[str, _Done] = dict(journal.rows)

    def todo(self) -> list[Queued]:
        """What has no grade yet, or none but by our fault."""
        return [each for each in self._rows.values() if not self._is_done(each)]

    def behaviours(self) -> dict[str, Behaviour]:
        """By student, in the order of their names."""
        return {student: self._done[student].behaviour for student in sorted(self._rows)}

    def go(self, todo: Sequence[Queued]) -> None:
        """Grade all of `todo`; what fails by our fault once more, and then it is listed."""
        for each in todo:
            if each.grade is not None:
                self._finish(each, each.grade, {})
        real = [each for each in todo if each.grade is None]
        failed = self._round(real, self._how.progress, self._how.first)
        again = self._round([each for each, _ in failed])
        for each, reason in again:
            self._finish(each, ungraded(self._assignment, each, Status.GRADER_ERROR, reason), {})

    def _is_done(self, each: Queued) -> bool:
        done = self._done.get(each.row.student)
        return done is not None and done.status is not Status.GRADER_ERROR

    def _round(
        self, rows: Sequence[Queued], progress: Progress | None = None, first: WorkerProcess | None = None
    ) -> list[tuple[Queued, str]]:
        """One try for each of `rows`; those that failed, with the reason."""
        if not rows:
            return []
        jobs, scheduler = self._how.jobs, self._how.scheduler
        shared = scheduler is None
        count = min(jobs or processors(), len(rows)) if shared else None
        work = partial(graded, setup_of(self._assignment, count, shared))
        limits = self._assignment.limits
        limit = _PATIENCE + _LONGEST * (limits.cpu_seconds + limits.wall_seconds)
        failed = []
        many: dict[str, Any] = {
            "jobs": jobs,
            "scheduler": scheduler,
            "progress": progress,
            "time_limit": limit,
            "first": first,
        }
        for outcome in spread(work, (self._task(each, shared) for each in rows), in_order=False, **many):
            each = rows[outcome.index]
            answer = _answer(outcome)
            if answer is None:
                failed.append((each, outcome.reason))
            else:
                self._finish(each, Grade.from_json(answer.grade), dict(answer.files), answer.seconds)
        return failed

    def _task(self, each: Queued, shared: bool) -> Task:
        assert each.code is not None  # it has no grade yet
        path = str((each.folder / CODE).resolve()) if shared else ""
        return Task(each.row.student, path, None if shared else each.code, each.row.time, each.notes, each.about)

    def _finish(self, each: Queued, grade: Grade, files: dict[str, bytes], seconds: float = 0.0) -> None:
        """Its files, then its line in the journal."""
        if FEEDBACK not in files:
            files[FEEDBACK] = feedback_page(self._assignment, grade).encode("utf-8", "replace")
        told = grade.to_json()
        files["grade.json"] = json.dumps(told, indent=1, allow_nan=False).encode() + b"\n"
        folder = each.folder
        write_files({folder / name: data for name, data in files.items()})
        self._journal.append({"student": each.row.student, "grade": told, "seconds": seconds})
        self._done[each.row.student] = _Done.of(told)


def _known(row: Mapping[str, Any]) -> tuple[str, _Done]:
    """What is kept in memory of a row of the journal."""
    return row["student"], _Done.of(row["grade"])


def _answer(outcome: Outcome) -> Answer | None:
    if not outcome.ok:
        return None
    answer = outcome.value
    assert isinstance(answer, Answer)
    if answer.missing:
        raise InputError(f"a worker cannot grade: {answer.missing}. What is graded is kept; go on with --resume")
    return answer
