"""Grading in a sitting: a batch in a process of its own, watched by its journal, which outlives the page."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.core.private_files import open_descriptor, open_private
from rds.grading.exports import GRADEBOOKS
from rds.panels.grading.review import entry_of, review_fields
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Field, Number, Text, labels
from rds.panels.session.session import Session
from rds.panels.session.task import Task

try:
    from fcntl import LOCK_EX, LOCK_NB, flock
except ImportError:  # Windows: a batch that goes on is not found again
    flock = None  # type: ignore[assignment]

if TYPE_CHECKING:
    from rds.grading.batch.finished import Finished
    from rds.grading.exports.export import Written
    from rds.grading.review.regrade import Change

LOCK = ".grading.lock"  # in the session's folder: locked while a batch goes on, with its process and folder in it
LOG = ".grading.log"  # what that batch says on stderr
_LOOKS = 0.2  # s between looks at the journal
_ENDS_IN = 10.0  # s that a check may take to end once it was asked to


@dataclass
class GradingState:
    """What is chosen, and the batch that goes on."""

    session: Session

    def __post_init__(self) -> None:
        self.choices: Choices = self.session.choices("grading", _fields())

    @property
    def out(self) -> Path:
        """The folder of the batch; InputError if none is named."""
        return self._path("out", "the folder for grades and feedback")

    def started(self) -> bool:
        """Whether there is a batch in the folder already, to be gone on with."""
        return bool(self.choices["out"]) and (self.out / "batch.json").is_file()

    def check(self) -> Task[str]:
        """Try the assignment itself: what `rds grade check` says."""
        assignment = self._path("assignment", "the assignment's folder")
        return self.session.work("check the assignment", lambda task: _said(["check", str(assignment)], task.pulse))

    def grade(self) -> Task[int]:
        """Begin, or go on with what is in the folder; the answer is how many are graded.

        Stopping lets what is being graded end; the rest can be graded later, as after a kill. The batch goes on if the
        page ends: `going_on` finds it again. The task's error says where another batch of this folder goes on.
        """
        words = [
            *("run", str(self._path("assignment", "the assignment's folder"))),
            *(str(self._path("submissions", "the folder of submissions")), "-o", str(self.out), "--json"),
            *(["--class", str(self._path("class_list", "the class list"))] if self.choices["class_list"] else []),
            *self._jobs(),
            *(["--scheduler", self.choices["scheduler"]] if self.choices["scheduler"] else []),
            *(["--resume"] if self.started() else []),
        ]
        batch = _Batch(self.session.folder)
        out = self.out
        return self.session.work("grade", lambda task: batch.begin(words, out, task), batch.stop)

    def going_on(self) -> Task[int] | None:
        """A batch that a page of this folder has begun and that goes on, to be followed or stopped; None: none does."""
        batch = _Batch(self.session.folder)
        if not batch.find():
            return None
        return self.session.work("grade", batch.follow, batch.stop)

    def finished(self) -> Finished:
        """The grades so far; InputError if there is no batch in the folder."""
        from rds.grading.batch.finished import read_finished

        return read_finished(self.out)

    def review(self) -> str:
        """Add what a grader says, and write all out again; what was kept, in a sentence."""
        from rds.grading.review.new_entries import say

        (entry,), finished = say(self.out, [entry_of(self.choices)])
        score = next((f": {g.score:g} points now" for g in finished.grades if g.student == entry.student), "")
        return f"entry {entry.number} is kept: {entry.kind} of {entry.about or f'entry {entry.value:g}'}{score}"

    def best(self) -> Task[str]:
        """Of this batch and the other attempts each student's best grade, as a new batch: see `rds grade best`.

        The answer says what was made. The attempts are in the order in which they are named, this batch the last.
        """
        from rds.grading.review.best import best

        named = [each.strip() for each in self.choices["attempts"].split(",") if each.strip()]
        if not named:
            raise InputError("name the folders of the other attempts, with commas between them")
        batches = [*(self.session.folder / each for each in named), self.out]
        new = self._path("new", "the new folder")

        def work(task: Task[str]) -> str:
            made = best(batches, new)
            return f"{len(made.grades)} students, the best of {len(batches)} attempts: {new}"

        return self.session.work("best of several attempts", work)

    def regrade(self) -> Task[int]:
        """Grade what this batch kept by the assignment as it is now, into the new folder; see `rds grade regrade`.

        The answer is how many are graded. Where it was stopped, it goes on the next time.
        """
        new = self._path("new", "the new folder")
        words = [
            *("regrade", str(self.out), str(self._path("assignment", "the assignment's folder"))),
            *("-o", str(new), "--json", *self._jobs()),
            *(["--resume"] if (new / "batch.json").is_file() else []),
        ]
        batch = _Batch(self.session.folder)
        return self.session.work("grade again", lambda task: batch.begin(words, new, task), batch.stop)

    def regraded(self) -> tuple[list[Change], int]:
        """Who changes by the new folder, and how many are not graded in it yet."""
        from rds.grading.batch.finished import read_finished
        from rds.grading.review.regrade import changes_of

        new = read_finished(self._path("new", "the new folder"))
        return changes_of(self.finished(), new), len(new.not_graded)

    def export(self, to: str) -> Written:
        """Write a gradebook; see `rds grade export`."""
        from rds.grading.exports.export import export
        from rds.grading.exports.exported import ExportOptions

        given = self.choices["gradebook"]
        return export(self.out, to, None, ExportOptions(self.session.folder / given if given else None, None, None))

    def _jobs(self) -> list[str]:
        return [] if self.choices["jobs"] is None else ["--jobs", str(self.choices["jobs"])]

    def _path(self, name: str, what: str) -> Path:
        if not self.choices[name]:
            raise InputError(f"name {what} (from {self.session.folder})")
        return self.session.folder / self.choices[name]


class _Batch:
    """`rds grade run` as a process that goes on if this page ends. It holds the lock, so that others find it."""

    def __init__(self, folder: Path):
        self._lock, self._log = folder / LOCK, folder / LOG
        self._process = 0
        self._child: subprocess.Popen[bytes] | None = None
        self._out = folder

    def begin(self, words: list[str], out: Path, task: Task[int]) -> int:
        """Start it, and follow it to its end."""
        self._out = out
        with self._claimed() as lock, open_private(self._log, "wb") as log:
            self._child = subprocess.Popen(
                [sys.executable, "-P", "-m", "rds", "grade", *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,  # a pipe that nobody reads would hold it up, and end it with this page
                env=_plain(),
                start_new_session=True,
                pass_fds=(lock,) if os.name == "posix" else (),
            )
            self._process = self._child.pid
            os.write(lock, json.dumps({"process": self._process, "out": str(out)}).encode())
        if task.stopping:
            self.stop()
        return self.follow(task)

    def find(self) -> bool:
        """Whether one goes on that another page has begun."""
        try:
            said = json.loads(self._lock.read_text())
            self._process, self._out = int(said["process"]), Path(said["out"])
        except (OSError, ValueError, KeyError, TypeError):
            return False
        return self._goes_on()

    def stop(self) -> None:
        """Let what is being graded end."""
        if self._process and self._goes_on():
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(self._process, signal.SIGINT)

    def follow(self, task: Task[int]) -> int:
        """Until its end; how many submissions are graded then."""
        while self._goes_on():
            done, of = progress(self._out)
            task.advance(done, of, f"{done} of {of} submissions" if of else "reading the submissions")
            time.sleep(_LOOKS)
        done, of = progress(self._out)
        code = self._child.returncode if self._child is not None else 0 if done == of else 2
        if code not in (0, 1, 130) and not task.stopping:
            said = self._log.read_text(errors="replace").strip()
            raise InputError(said.removeprefix("rds: ") or f"grading ended with code {code}")
        return done

    def _goes_on(self) -> bool:
        if self._child is not None:
            return self._child.poll() is None
        try:
            with self._claimed():
                return False
        except InputError:
            return flock is not None

    @contextlib.contextmanager
    def _claimed(self) -> Iterator[int]:
        """The lock's file, empty; InputError where a batch holds it, or it cannot be written."""
        try:
            descriptor = open_descriptor(self._lock, os.O_RDWR | os.O_CREAT, is_own=True)
        except OSError as error:
            raise InputError(f"cannot be written: {error.strerror}", str(self._lock)) from error
        try:
            if flock is not None:
                try:
                    flock(descriptor, LOCK_EX | LOCK_NB)
                except OSError:
                    raise InputError(
                        "a batch of this folder goes on already: wait for it, or reload the page and stop it"
                    ) from None
            os.truncate(descriptor, 0)
            yield descriptor
        finally:
            os.close(descriptor)


def progress(out: Path) -> tuple[int, int]:
    """How many submissions of a batch are graded, of how many; (0, 0) before it has begun."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        of = len(json.loads((out / "batch.json").read_bytes()).get("handed_in", ()))
        with contextlib.suppress(FileNotFoundError):
            return min((out / "journal.jsonl").read_bytes().count(b"\n"), of), of
        return 0, of
    return 0, 0


def _plain() -> dict[str, str]:
    """The environment without what a notebook's kernel sets to get colours: they would be characters in the text."""
    return {name: value for name, value in os.environ.items() if name not in ("FORCE_COLOR", "CLICOLOR_FORCE")}


def _said(words: list[str], pulse: Callable[[], None]) -> str:
    """What a command of `rds grade` says; InputError where it refuses. What `pulse()` raises ends it."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rds", "grade", *words],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=err,
            env=_plain(),
            start_new_session=True,
        )
        try:
            while process.poll() is None:
                pulse()
                time.sleep(_LOOKS)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)  # so that it takes its sandbox away
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(_ENDS_IN)
                process.kill()
                process.wait()
        for stream in (out, err):
            stream.seek(0)
        said, refused = out.read().decode(errors="replace"), err.read().decode(errors="replace")
    if process.returncode == 2:
        raise InputError(refused.strip().removeprefix("rds: "))
    return said + refused


def _gradebooks() -> dict[str, str]:
    own = {"nbgrader": "nbgrader", "prairielearn": "PrairieLearn", "lti": "LTI 1.3"}
    return labels(GRADEBOOKS.names(), own | {"moodle-feedback": "Moodle: feedback files"})


def _fields() -> Iterable[Field]:
    yield Text("assignment", "Assignment", "its folder, with assignment.toml", "", "e.g. assignments/tracking")
    yield Text(
        "submissions", "Submissions", "their folder, or the zip as the platform exports it", "", "e.g. submitted"
    )
    yield Text(
        "out", "Grades", "a new folder for grades and feedback, or that of a batch to go on with", "", "e.g. grades"
    )
    told = "a table of the students: sections, groups, extensions; empty: none, or that of a batch to go on with"
    yield Text("class_list", "Class list", told, "", "e.g. class.csv")
    yield Number("jobs", "Jobs", "processes side by side", None, low=1, high=256, whole=True, optional=True)
    yield Text("scheduler", "Scheduler", "of a dask cluster; empty: this computer", "", "e.g. tls://host:8786")
    yield from review_fields()
    yield Choice("to", "Gradebook", "what grades are exported to", "nbgrader", _gradebooks())
    yield Text(
        "gradebook", "Your gradebook", "as the platform exports it; nbgrader's gradebook.db; LTI's folder", "", ""
    )


def rows(grades: Iterable[Any]) -> list[list[Any]]:
    """Student, status, score, and what happened, for a table: the worst first."""
    ordered = sorted(grades, key=lambda grade: (grade.score, grade.student))
    return [
        [grade.student, str(grade.status), f"{grade.score:g} / {grade.max_score:g}", grade.reason] for grade in ordered
    ]
