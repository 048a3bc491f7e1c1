"""Grading in a sitting: a batch in a process of its own, watched by its journal, which outlives the page."""

from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.session.choices import Choices
from rds.session.fields import Choice, Field, Number, Text
from rds.session.session import Session
from rds.session.task import Task

if TYPE_CHECKING:
    from rds.grading.export import Written
    from rds.grading.finished import Finished

GRADEBOOKS = {
    "nbgrader": "nbgrader",
    "moodle": "Moodle",
    "canvas": "Canvas",
    "gradescope": "Gradescope",
    "prairielearn": "PrairieLearn",
}
_LOOKS = 0.2  # s between looks at the journal


@dataclass
class GradingDesk:
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
        return self.session.work("check the assignment", lambda task: _said(["check", str(assignment)]))

    def grade(self) -> Task[int]:
        """Begin, or go on with what is in the folder; the answer is how many are graded.

        Stopping lets what is being graded end; the rest can be graded later, as after a kill.
        """
        words = [
            *("run", str(self._path("assignment", "the assignment's folder"))),
            *(str(self._path("submissions", "the folder of submissions")), "-o", str(self.out), "--json"),
            *([] if self.choices["jobs"] is None else ["--jobs", str(self.choices["jobs"])]),
            *(["--scheduler", self.choices["scheduler"]] if self.choices["scheduler"] else []),
            *(["--resume"] if self.started() else []),
        ]
        batch = _Batch(words, self.out)
        return self.session.work("grade", batch.follow, batch.stop)

    def finished(self) -> Finished:
        """The grades so far; InputError if there is no batch in the folder."""
        from rds.grading.finished import read_finished

        return read_finished(self.out)

    def export(self, to: str) -> Written:
        """Write a gradebook; see `rds grade export`."""
        from rds.grading.export import export
        from rds.grading.exports.exported import Wanted

        given = self.choices["gradebook"]
        return export(self.out, to, None, Wanted(self.session.folder / given if given else None, None, None))

    def _path(self, name: str, what: str) -> Path:
        if not self.choices[name]:
            raise InputError(f"name {what} (from {self.session.folder})")
        return self.session.folder / self.choices[name]


class _Batch:
    """`rds grade run` as a process: it goes on if this page ends."""

    def __init__(self, words: list[str], out: Path):
        self._words, self._out = words, out
        self._process: subprocess.Popen[str] | None = None

    def stop(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)

    def follow(self, task: Task[int]) -> int:
        command = [sys.executable, "-m", "rds", "grade", *self._words]
        self._process = process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
        )  # fmt: skip
        assert process.stderr is not None
        if task.stopping:
            self.stop()
        while process.poll() is None:
            done, of = progress(self._out)
            task.advance(done, of, f"{done} of {of} submissions" if of else "reading the submissions")
            time.sleep(_LOOKS)
        said = process.stderr.read().strip()
        if process.returncode not in (0, 1, 130):
            raise InputError(said.removeprefix("rds: ") or f"grading ended with code {process.returncode}")
        return progress(self._out)[0]


def progress(out: Path) -> tuple[int, int]:
    """How many submissions of a batch are graded, of how many; (0, 0) before it has begun."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        of = len(json.loads((out / "batch.json").read_bytes()).get("handed_in", ()))
        with contextlib.suppress(FileNotFoundError):
            return min((out / "journal.jsonl").read_bytes().count(b"\n"), of), of
        return 0, of
    return 0, 0


def _said(words: list[str]) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "rds", "grade", *words], capture_output=True, text=True, check=False, timeout=600
    )
    if done.returncode == 2:
        raise InputError(done.stderr.strip().removeprefix("rds: "))
    return done.stdout + done.stderr


def _fields() -> Iterable[Field]:
    yield Text("assignment", "Assignment", "its folder, with assignment.toml", "", "e.g. assignments/tracking")
    yield Text(
        "submissions", "Submissions", "their folder, or the zip as the platform exports it", "", "e.g. submitted"
    )
    yield Text(
        "out", "Grades", "a new folder for grades and feedback, or that of a batch to go on with", "", "e.g. grades"
    )
    yield Number("jobs", "Jobs", "processes side by side", None, low=1, high=256, whole=True, optional=True)
    yield Text("scheduler", "Scheduler", "of a dask cluster; empty: this computer", "", "e.g. tcp://host:8786")
    yield Choice("to", "Gradebook", "what grades are exported to", "nbgrader", GRADEBOOKS)
    yield Text("gradebook", "Your gradebook", "as downloaded from Canvas or Moodle; nbgrader's gradebook.db", "", "")


def rows(grades: Iterable[Any]) -> list[list[Any]]:
    """Student, status, score, and what happened, for a table: the worst first."""
    ordered = sorted(grades, key=lambda grade: (grade.score, grade.student))
    return [
        [grade.student, str(grade.status), f"{grade.score:g} / {grade.max_score:g}", grade.reason] for grade in ordered
    ]
