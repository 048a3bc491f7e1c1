"""Batches: one row for each submission, the same scores however it is run, and nothing lost in a kill."""

from __future__ import annotations

import errno
import json
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from waiting import wait_for

from rds.cli.grade_run import run_alone
from rds.core.errors import InputError
from rds.core.parallel import Outcome
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.hand_out import hand_out
from rds.grading.batch import run as run_module
from rds.grading.batch.journal import Journal, read_journal
from rds.grading.batch.outcome import BatchOutcome
from rds.grading.batch.record import Record, check_same
from rds.grading.batch.run import run_batch
from rds.grading.batch.warm_worker import _tried
from rds.grading.grade import Grade, Status
from rds.grading.sandbox import SandboxError, available
from tests.grading.batches import ASSIGNMENT, law, notebook, put
from tests.grading.made import assignment_in

pytestmark = pytest.mark.skipif(available() is not None, reason=str(available()))

HANDED_IN = {
    "ada.py": law(),
    "ben/controller.py": law(10.0),
    "cy.py": "def control(t, r, y, state, params):\n    return float('nan'), state\n",
    "dan.py": "import os\nos._exit(0)\n",
    "eve.py": "def control(:\n",
    "flo/readme.txt": "",
    "gus.ipynb": notebook("import pandas\nparams = {}", "def control(t, r, y, state, params):\n    return 0.0, state"),
    "hal.py": "print('<b>full marks</b>')\n" + law(),
    "ivy.py": law(),
    "timestamps.csv": "student,timestamp\nivy,2026-01-12T11:00:00\n",
}
STATUSES = {
    "ada": Status.OK,
    "ben": Status.OK,
    "cy": Status.BROKE_CONTRACT,
    "dan": Status.KILLED,
    "eve": Status.FAILED_TO_LOAD,
    "flo": Status.MISSING,
    "gus": Status.OK,
    "hal": Status.OK,
    "ivy": Status.OK,
    "jo": Status.REFUSED,
}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The assignment in `task`, submissions in `in`."""
    folder = tmp_path_factory.mktemp("batch")
    assignment_in(folder / "task", ASSIGNMENT, law())
    put(folder / "in", HANDED_IN)
    (folder / "in/jo.py").symlink_to("/etc/passwd")
    return folder


@pytest.fixture(scope="module")
def outcome(place: Path) -> BatchOutcome:
    """All of it graded by two jobs."""
    return run_batch(place / "task", place / "in", place / "out", jobs=2)


def without_time(grades: Any) -> str:
    return json.dumps({name: grade.to_json() for name, grade in grades.items()}, sort_keys=True)


def test_a_row_for_each_whatever_happened(outcome: BatchOutcome) -> None:
    assert {name: grade.status for name, grade in outcome.grades.items()} == STATUSES
    assert list(outcome.grades) == sorted(STATUSES)
    for grade in outcome.grades.values():
        assert (grade.reason == "") == (grade.status is Status.OK)
        assert grade.max_score == 15.0 and len(grade.criteria) == 2
        assert (grade.score > 0.0) == (grade.student in ("ada", "ben", "hal", "ivy", "gus"))


def test_messages_call_a_file_by_the_name_that_was_handed_in(outcome: BatchOutcome, place: Path) -> None:
    """It was submission.py for everybody."""
    page = (place / "out/students/eve/feedback.html").read_text()
    assert "eve.py:1" in outcome.grades["eve"].reason and "eve.py:1" in page and "submission.py" not in page


def test_who_is_late_loses_and_whose_notebook_was_cut_is_told(outcome: BatchOutcome) -> None:
    ivy, gus = outcome.grades["ivy"], outcome.grades["gus"]
    assert ivy.late_days == pytest.approx(2.0 - 1.0 / 24.0)
    assert ivy.score == pytest.approx(0.8 * ivy.before_penalty)
    assert outcome.grades["ada"].late_days == 0.0
    assert any("is not known of 8 of 9 submissions" in note for note in outcome.notes)  # and flo handed in nothing
    assert any("only these are graded" in note for note in gus.notes)


def test_whose_time_cannot_be_understood_is_named(tmp_path: Path) -> None:
    assignment_in(tmp_path / "task", ASSIGNMENT, law())
    told = {"ada/task/timestamp.txt": "2026-01-12 10:00:00 CST", "ben/task/timestamp.txt": "2026-01-12 10:00:00 CET"}
    put(tmp_path / "in", {f"{name}/task/readme.txt": "" for name in ("ada", "ben")} | told)
    notes = run_batch(tmp_path / "task", tmp_path / "in", tmp_path / "out", jobs=1).notes
    assert any(
        note.startswith("ada: ") and "cannot be understood ('2026-01-12 10:00:00 CST' in its timestamp.txt)" in note
        for note in notes
    )
    assert not any(note.startswith("ben") for note in notes)


def test_what_the_folder_holds(place: Path, outcome: BatchOutcome) -> None:
    out = place / "out"
    for name, grade in outcome.grades.items():
        folder = out / "students" / name
        assert Grade.from_json(json.loads((folder / "grade.json").read_text())) == grade
        assert "<b>full marks" not in (folder / "feedback.html").read_text()
    assert (out / "students/ada/submission.py").read_text() == law()
    assert {row["student"] for row in read_journal(out / "journal.jsonl")} == set(STATUSES)
    from pyarrow.parquet import read_table

    columns = read_table(out / "students/ada/columns.parquet")
    assert columns.num_rows == 200 and {"case", "run", "time", "X_measured"} <= set(columns.column_names)


def test_the_json_has_exactly_what_is_promised(outcome: BatchOutcome) -> None:
    told = outcome.to_json()
    assert set(told) == {"students", "submissions_per_second"}
    assert told["submissions_per_second"] > 0.0
    ada = told["students"]["ada"]
    assert set(ada) == {"status", "score", "max_score", "criteria"}
    assert set(ada["criteria"]["rms"]) == {"score", "max_score", "value"}
    assert ada["status"] == "ok" and told["students"]["eve"]["criteria"]["rms"]["value"] is None


def test_one_job_in_another_order_gives_the_same(place: Path, outcome: BatchOutcome) -> None:
    other = run_batch(place / "task", place / "in", place / "alone", jobs=1)
    assert without_time(other.grades) == without_time(outcome.grades)


def test_a_finished_batch_has_nothing_left_to_do(place: Path, outcome: BatchOutcome) -> None:
    before = (place / "out/journal.jsonl").read_bytes()
    again = run_batch(place / "task", place / "in", place / "out", resume=True)
    assert again.graded_now == 0 and again.submissions_per_second == 0.0
    assert without_time(again.grades) == without_time(outcome.grades)
    assert (place / "out/journal.jsonl").read_bytes() == before


def test_a_folder_that_is_there_is_refused(place: Path, outcome: BatchOutcome, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds a batch already"):
        run_batch(place / "task", place / "in", place / "out")
    put(tmp_path, {"mine/thesis.txt": "", "file": ""})
    for name, said in (("mine", "is not empty"), ("file", "not a folder")):
        with pytest.raises(InputError, match=said):
            run_batch(place / "task", place / "in", tmp_path / name)


def test_what_no_student_handed_in_is_no_submission(place: Path, outcome: BatchOutcome, tmp_path: Path) -> None:
    """Grades among the submissions would be a student the next time."""
    for handed_in, out, said in (
        ("task", tmp_path / "out", "holds an assignment"),
        ("out", tmp_path / "out", "holds the grades of a batch"),
        ("in", place / "in" / "grades", "inside the submissions"),
    ):
        with pytest.raises(InputError, match=said):
            run_batch(place / "task", place / handed_in, out)
        assert not out.exists()


def command(place: Path, out: Path, *words: str) -> list[str]:
    return [sys.executable, "-m", "rds", "grade", "run", str(place / "task"), str(place / "in"), "-o", str(out), *words]


def test_killed_at_any_moment_and_resumed_the_scores_are_the_same(
    place: Path, outcome: BatchOutcome, tmp_path: Path
) -> None:
    out, draw = tmp_path / "out", random.Random(5)
    kills = 0
    for attempt in range(4):
        process = subprocess.Popen(command(place, out, "--resume", "--jobs", "2"), stderr=subprocess.DEVNULL)
        deadline = time.monotonic() + 30.0
        before = len(read_journal(out / "journal.jsonl")) if (out / "journal.jsonl").exists() else 0
        while process.poll() is None and time.monotonic() < deadline:  # until it has got somewhere, and a bit more
            size = (out / "journal.jsonl").stat().st_size if (out / "journal.jsonl").exists() else -1
            if (attempt < 2 and size >= 0) or (size > 0 and lines(out) > before):
                break
            time.sleep(0.01)
        time.sleep(draw.uniform(0.0, 0.1))
        kills += process.poll() is None
        process.kill()
        process.wait()
        if lines(out) >= len(STATUSES):
            break
        with open(out / "journal.jsonl", "ab") as journal:  # as if the kill had come in the middle of a write
            journal.write(b'0123456789abcdef {"student": "ad')
    assert kills >= 2
    rows = read_journal(out / "journal.jsonl")
    assert len({row["student"] for row in rows}) == len(rows)  # nothing was graded twice once it was known
    done = run_batch(place / "task", place / "in", out, resume=True)
    assert without_time(done.grades) == without_time(outcome.grades)


def lines(out: Path) -> int:
    path = out / "journal.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def test_ctrl_c_ends_it_and_resume_goes_on(place: Path, outcome: BatchOutcome, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen(command(place, out, "--jobs", "1"), stderr=subprocess.PIPE, text=True)
    wait_for(lambda: lines(out) >= 3 or process.poll() is not None)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 130 and "--resume" in said and "Traceback" not in said
    found = subprocess.run(command(place, out, "--resume", "--json"), capture_output=True, text=True, check=False)
    assert found.returncode == 0 and "graded already" in found.stderr
    told = json.loads(found.stdout)
    assert told["students"] == outcome.to_json()["students"]


def test_what_could_not_be_read_before_may_have_a_time_now(tmp_path: Path) -> None:
    """In Gradescope's folders, say, the time is that of the file that is chosen."""
    before = Record("Small", "", "1", {}, {"ada": "grader error: cannot be opened"}, {}, "gradescope", None)
    now = replace(before, handed_in={"ada": "2"}, times={"ada": "2026-01-09T10:00:00+00:00"})
    check_same(before, now, tmp_path)
    with pytest.raises(InputError, match=r"times of submission \(ada\)"):
        check_same(replace(now, times={}), now, tmp_path)


def test_what_has_changed_is_told_and_nothing_is_graded(place: Path, tmp_path: Path) -> None:
    task = assignment_in(tmp_path / "task", ASSIGNMENT, law())
    handed_in = put(tmp_path / "in", {"ada.py": law(), "ben.py": "x", "timestamps.csv": "student,timestamp\n"})
    run_batch(task, handed_in, tmp_path / "out", jobs=1)
    before = (tmp_path / "out/journal.jsonl").read_bytes()

    def refused(said: str) -> None:
        with pytest.raises(InputError, match=said):
            run_batch(task, handed_in, tmp_path / "out", resume=True)
        assert (tmp_path / "out/journal.jsonl").read_bytes() == before

    put(handed_in, {"ben.py": "y"})
    refused(r"submissions \(ben\)")
    put(handed_in, {"ben.py": "x", "timestamps.csv": "student,timestamp\nada,2026-01-12T11:00:00\n"})
    refused(r"times of submission \(ada\)")
    (handed_in / "ben.py").unlink()
    put(handed_in, {"timestamps.csv": "student,timestamp\n"})
    refused(r"submissions gone \(ben\)")
    put(handed_in, {"ben.py": "x"})
    put(task, {"assignment.toml": ASSIGNMENT.replace("points = 5.0", "points = 6.0")})
    refused("the assignment")
    put(task, {"assignment.toml": ASSIGNMENT})
    put(handed_in, {"cy.py": "z"})  # who comes later is graded, and nobody else
    added = run_batch(task, handed_in, tmp_path / "out", resume=True)
    assert added.graded_now == 1 and list(added.grades) == ["ada", "ben", "cy"]
    assert (tmp_path / "out/journal.jsonl").read_bytes().startswith(before)


def test_our_own_errors_are_tried_again_then_listed_and_never_a_zero(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tries: list[str] = []

    def spread(work: Any, tasks: list[Any], **_: Any) -> Any:
        for index, task in enumerate(tasks):
            if not hasattr(task, "student"):  # other work of the batch: submissions compared
                yield Outcome(index, work(task))
                continue
            tries.append(task.student)
            try:
                if task.student == "ada" or (task.student == "ben" and tries.count("ben") == 1):
                    raise SandboxError("the warm interpreter is gone")
                yield Outcome(index, work(task))
            except SandboxError as error:
                from rds.core.parallel.outcome import Failure

                yield Outcome(index, failure=Failure.RAISED, reason=str(error))

    handed_in = put(tmp_path / "in", {"ada.py": law(), "ben.py": law()})
    with monkeypatch.context() as patch:
        patch.setattr(run_module, "spread", spread)
        found = run_batch(place / "task", handed_in, tmp_path / "out", jobs=1)
    assert tries == ["ada", "ben", "ada", "ben"]
    assert found.grader_errors == ("ada",) and found.grades["ben"].status is Status.OK
    told = found.to_json()["students"]["ada"]
    assert told == {"status": "grader error", "score": None, "max_score": 15.0, "criteria": {}}
    again = run_batch(place / "task", handed_in, tmp_path / "out", jobs=1, resume=True)
    assert again.graded_now == 1 and again.grades["ada"].status is Status.OK and not again.grader_errors


def test_what_the_grader_may_not_read_is_no_zero_and_is_graded_once_it_may(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(tmp_path / "in", {"ada.py": law(), "bob.py": law(), "cy/controller.py": law()})
    opened, listed = os.open, os.scandir

    def no_bob(path: Any, *rest: Any, **more: Any) -> int:
        if str(path).endswith("in/bob.py"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return opened(path, *rest, **more)

    def no_cy(path: Any) -> Any:
        if str(path).endswith("in/cy"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        return listed(path)

    with monkeypatch.context() as closed:
        closed.setattr(os, "open", no_bob)
        closed.setattr(os, "scandir", no_cy)
        found = run_batch(place / "task", tmp_path / "in", tmp_path / "out", jobs=1)
    assert found.grades["ada"].status is Status.OK
    for student in ("bob", "cy"):
        grade = found.grades[student]
        assert grade.status is Status.GRADER_ERROR and "must be able to read it" in grade.reason
    again = run_batch(place / "task", tmp_path / "in", tmp_path / "out", jobs=1, resume=True)
    assert [grade.status for grade in again.grades.values()] == [Status.OK] * 3 and again.graded_now == 2


def test_a_worker_that_dies_is_replaced(place: Path, tmp_path: Path) -> None:
    handed_in = put(tmp_path / "in", {f"s{n}.py": law(10.0 + n) for n in range(6)})
    killed: list[int] = []

    def kill_one(done: int, of: int) -> None:
        if done == 2:
            for path in Path("/proc").glob("[0-9]*/cmdline"):
                process = int(path.parent.name)
                words = path.read_bytes() if path.exists() else b""
                status = (path.parent / "stat").read_text() if path.exists() else ""
                if b"rds.core.parallel.worker" in words and int(status.rpartition(")")[2].split()[1]) == os.getpid():
                    os.kill(process, signal.SIGKILL)
                    killed.append(process)
                    return

    found = run_batch(place / "task", handed_in, tmp_path / "out", jobs=1, progress=kill_one)
    assert killed and {grade.status for grade in found.grades.values()} == {Status.OK}


def test_of_two_graders_of_one_folder_the_second_changes_nothing(place: Path, tmp_path: Path) -> None:
    """Also where both found it empty: the record is that of the one whose grades are there."""
    handed_in, out = put(tmp_path / "in", {"ada.py": law()}), tmp_path / "out"
    with Journal(out / "journal.jsonl"), pytest.raises(InputError, match="another rds grade run"):
        run_batch(place / "task", handed_in, out, jobs=1)
    assert [path.name for path in out.iterdir()] == ["journal.jsonl"]
    assert run_batch(place / "task", handed_in, out, jobs=1).graded_now == 1  # ended before it had begun: free again


def test_a_disk_that_is_full_loses_nothing(place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    handed_in, out = put(tmp_path / "in", {"ada.py": law(), "ben.py": "x"}), tmp_path / "out"
    write = os.write

    def full(descriptor: int, data: bytes) -> int:
        if b'"student": "ben"}' in data:
            if len(data) < 100:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return write(descriptor, data[:-50])
        return write(descriptor, data)

    with monkeypatch.context() as patch, pytest.raises(InputError, match=r"No space left.*--resume"):
        patch.setattr("rds.grading.batch.journal.os.write", full)
        run_batch(place / "task", handed_in, out, jobs=1)
    assert [row["student"] for row in read_journal(out / "journal.jsonl")] == ["ada"]
    found = run_batch(place / "task", handed_in, out, jobs=1, resume=True)
    assert found.graded_now == 1 and found.grades["ben"].status is Status.FAILED_TO_LOAD


def test_the_plain_command_line_needs_no_reader_of_command_lines(
    place: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    put(tmp_path / "in", {"ada.py": law()})
    words = ["grade", "run", str(place / "task"), str(tmp_path / "in"), "-o", str(tmp_path / "out")]
    assert run_alone([*words, "--json"]) is None and run_alone(["grade", "run", "--help", *words[3:]]) is None
    for name in ("keep_process_private", "say_notices"):  # these are for the whole process
        monkeypatch.setattr(f"rds.cli.grade_run.{name}", lambda: None)
    monkeypatch.setattr("rds.grading.batch.warm_worker._tried", len)  # which of None is no fault, but an error
    monkeypatch.setattr("rds.grading.sandbox.available", lambda: "it does not hold")
    assert run_alone(words) == 2 and "rds: it does not hold" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    monkeypatch.setattr("rds.grading.batch.warm_worker._tried", _tried)
    assert run_alone(words) == 0 and "graded 1 in" in capsys.readouterr().out
    assert read_journal(tmp_path / "out/journal.jsonl")[0]["grade"]["status"] == "ok"
    assert run_alone(words) == 2 and "holds a batch already" in capsys.readouterr().err


def test_nobody_is_graded_by_the_students_copy(tmp_path: Path) -> None:
    hand_out(read_assignment(assignment_in(tmp_path / "task", ASSIGNMENT)), tmp_path / "for-students")
    put(tmp_path / "submitted", {"ada.py": law()})
    with pytest.raises(InputError, match="students' copy of an assignment"):
        run_batch(tmp_path / "for-students", tmp_path / "submitted", tmp_path / "grades")
    assert not (tmp_path / "grades").exists()
