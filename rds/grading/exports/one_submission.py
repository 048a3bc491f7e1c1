"""One submission in the container of a platform: graded in the sandbox, answered in the platform's own file.

python -P -m rds.grading.exports.one_submission gradescope /autograder
python -P -m rds.grading.exports.one_submission prairielearn /grade

Whatever happens there is a `results.json`. Where the sandbox does not hold, nothing is run, and it says so.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import stat
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from rds.core.atomic import write_whole
from rds.core.errors import InputError, RdsError
from rds.core.private_files import keep_process_private, open_private
from rds.grading.batch.run import run_batch
from rds.grading.batch.scratch import scratch
from rds.grading.exports import GRADEBOOKS
from rds.grading.exports.export import export
from rds.grading.exports.exported import ExportOptions
from rds.grading.grade import Grade, Status
from rds.grading.intake.items import DEEPEST
from rds.grading.intake.layouts import TIMES
from rds.grading.intake.names import shown
from rds.grading.intake.notebooks import LARGEST

RESULTS = "results/results.json"


@dataclass(frozen=True)
class Container:
    """Where a platform puts things, below its folder. `who` gives the student and the time, "" where unknown."""

    submission: str
    assignment: str
    about: str
    who: Callable[[Mapping[str, Any]], tuple[str, str]]


def _of_gradescope(about: Mapping[str, Any]) -> tuple[str, str]:
    """The first of the submitters: a group's plants are his."""
    users = about.get("users") or [{}]
    return str(users[0].get("email") or users[0].get("id") or ""), str(about.get("created_at") or "")


def _of_prairielearn(about: Mapping[str, Any]) -> tuple[str, str]:
    """PrairieLearn tells the variant, not the student: every variant has plants of its own."""
    return f"variant-{about.get('variant_seed', '')}", ""


CONTAINERS: Mapping[str, Container] = {
    "gradescope": Container("submission", "source/assignment", "submission_metadata.json", _of_gradescope),
    "prairielearn": Container("student", "tests/assignment", "data/data.json", _of_prairielearn),
}


def grade_in(platform: str, root: Path) -> Path:
    """Grade the submission in the container below `root`; the path of the answer, which is there in any case.

    InputError only for a platform without a container.
    """
    if platform not in CONTAINERS:
        raise InputError(f"there is no container of {platform!r}; known: {', '.join(CONTAINERS)}")
    target = root / RESULTS
    target.unlink(missing_ok=True)
    try:
        _grade(CONTAINERS[platform], platform, root, target)
    except Exception as error:  # whatever it is: without an answer nobody hears of it
        said = str(error) if isinstance(error, RdsError | OSError) else f"{type(error).__name__}: {error}"
        _answer_failure(platform, target, said)
    target.chmod(0o644)  # for the platform, which may be another user outside of the container; inside there is none
    return target


def _grade(container: Container, platform: str, root: Path, target: Path) -> None:
    about = json.loads((root / container.about).read_bytes())
    student, time = container.who(about)
    student = student.strip().replace("/", "_") or "student"
    with scratch("one") as work:
        # one folder more: none of the student's own is called as a platform's would be, and makes a student of its name
        folder = work / "submissions" / student / "submission"
        given = root / container.submission
        shutil.copytree(given, folder, symlinks=True, copy_function=_copied, ignore=partial(_too_deep, given))
        if time:
            with open_private(work / "submissions" / TIMES, "w", newline="", encoding="utf-8") as stream:
                csv.writer(stream).writerows([["student", "timestamp"], [shown(student), time]])
        run_batch(root / container.assignment, work / "submissions", work / "out", jobs=1)
        export(work / "out", platform, target, ExportOptions())


def _too_deep(given: Path, folder: str, names: list[str]) -> list[str]:
    """What lies in more folders than are looked into: thousands, one in the other, would end the copying."""
    return names if len(Path(folder).relative_to(given).parts) > DEEPEST else []


def _copied(source: str, target: str) -> None:
    """A file's copy. What is none, as a FIFO, is made again empty, so that its author hears what was handed in.

    So is a file larger than any that is read, which could fill the disk: it keeps its size, and takes no room.
    """
    about = os.lstat(source)
    kind = stat.S_IFMT(about.st_mode)
    if kind == stat.S_IFREG and about.st_size > LARGEST:
        with open_private(Path(target), "wb") as file:
            file.truncate(about.st_size)
    elif kind == stat.S_IFREG:
        shutil.copy2(source, target)
    else:
        os.mknod(target, kind | 0o600)


def _answer_failure(platform: str, target: Path, reason: str) -> None:
    """An answer without a score: the platform then says that grading failed, and the student can ask."""
    failed = Grade("", Status.GRADER_ERROR, f"nothing was graded: {reason}", 0.0, 0.0, 0.0, ())
    write_whole(target, json.dumps(GRADEBOOKS.module(platform).results(failed, ())).encode())


def main(arguments: Sequence[str]) -> int:
    """The command; 2 if it is not called as above."""
    if len(arguments) != 2 or arguments[0] not in CONTAINERS:
        sys.stderr.write(f"usage: python -P -m rds.grading.exports.one_submission {{{','.join(CONTAINERS)}}} FOLDER\n")
        return 2
    sys.stderr.write(f"wrote {grade_in(arguments[0], Path(arguments[1]))}\n")
    return 0


if __name__ == "__main__":
    keep_process_private()
    raise SystemExit(main(sys.argv[1:]))
