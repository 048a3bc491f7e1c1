"""What the grading panel needs without a batch; a whole batch is graded in tests/grading and in the browser."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from waiting import wait_for

from rds.core.errors import InputError
from rds.grading.batch.run import run_batch
from rds.grading.grade import Grade, Status
from rds.grading.review.applied import of_review
from rds.grading.review.tables import log, waiting
from rds.grading.sandbox import available
from rds.panels.grading.state import GradingState, _said, progress, rows
from rds.panels.session import Session
from tests.grading.batches import law, put
from tests.grading.grades import grade
from tests.grading.made import HEAD, RMS, SINE, assignment_in
from tests.grading.test_review import made


def test_progress_is_what_the_journal_has(tmp_path: Path) -> None:
    assert progress(tmp_path) == (0, 0)
    (tmp_path / "batch.json").write_text(json.dumps({"handed_in": {"a": "1", "b": "2", "c": "3"}}))
    assert progress(tmp_path) == (0, 3)
    (tmp_path / "journal.jsonl").write_text("{}\n{}\nhalf a li")
    assert progress(tmp_path) == (2, 3)
    (tmp_path / "batch.json").write_text("[")
    assert progress(tmp_path) == (0, 0)


def test_what_is_missing_is_said_at_once(tmp_path: Path) -> None:
    state = GradingState(Session(tmp_path))
    with pytest.raises(InputError, match="name the assignment's folder"):
        state.grade()
    state.choices.set("assignment", "a")
    with pytest.raises(InputError, match="name the folder of submissions"):
        state.grade()
    state.choices.set("submissions", "s")
    with pytest.raises(InputError, match="name the folder for grades"):
        state.grade()
    assert not state.started()


def test_an_assignment_that_is_not_there_is_the_task_s_error(tmp_path: Path) -> None:
    state = GradingState(Session(tmp_path))
    for name in ("assignment", "submissions", "out"):
        state.choices.set(name, name)
    task = state.grade()
    assert task.wait(120) and isinstance(task.error, InputError) and "assignment" in str(task.error)


def test_a_class_list_goes_to_the_batch(tmp_path: Path) -> None:
    state = GradingState(Session(tmp_path))
    for name in ("assignment", "submissions", "out", "class_list"):
        state.choices.set(name, name)
    (tmp_path / "submissions").mkdir()
    task = state.grade()
    assert task.wait(120) and "class_list" in str(task.error), task.error


def test_what_a_command_says_is_plain_text_in_a_notebook_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")  # as IPython's kernel does
    monkeypatch.setenv("CLICOLOR_FORCE", "1")
    said = _said(["check", "--help"], lambda: None)
    assert "Usage" in said and "\x1b" not in said


def test_the_worst_come_first() -> None:
    def grade(student: str, score: float) -> Grade:
        return Grade(student, Status.OK, "", score, 10.0, score, ())

    assert [row[0] for row in rows([grade("ada", 10.0), grade("zoe", 0.0), grade("ben", 0.0)])] == ["ben", "zoe", "ada"]


SLOW = """
import json, os, signal, sys, time
signal.signal(signal.SIGINT, lambda *_: os._exit(130))
sys.stderr.write("a warning\\n" * 20_000)  # more than a pipe holds
open(sys.argv[1], "w").write("begun")
time.sleep(60)
"""


@pytest.fixture
def slow_grading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """In place of `rds grade`: a process that says much, and ends when it is interrupted. The file that it makes."""
    import subprocess

    real, begun = subprocess.Popen, tmp_path / "begun"

    def popen(command: list[str], **options: Any) -> Any:
        return real([command[0], "-c", SLOW, str(begun)], **options)

    monkeypatch.setattr("rds.panels.grading.state.subprocess.Popen", popen)
    return begun


def test_a_batch_goes_on_without_its_page_and_another_finds_and_stops_it(slow_grading: Path, tmp_path: Path) -> None:
    state = GradingState(Session(tmp_path))
    assert state.going_on() is None
    for name in ("assignment", "submissions", "out"):
        state.choices.set(name, name)
    first = state.grade()
    wait_for(slow_grading.exists)
    other = GradingState(Session(tmp_path))
    second = other.grade()
    assert second.wait(20) and "a batch of this folder goes on already" in str(second.error)
    again = other.going_on()
    assert again is not None and not again.wait(0.3)
    again.stop()
    assert again.wait(20) and again.error is None
    assert first.wait(20) and first.error is None and other.going_on() is None


def test_a_check_of_an_assignment_is_stopped(slow_grading: Path, tmp_path: Path) -> None:
    state = GradingState(Session(tmp_path))
    state.choices.set("assignment", "assignment")
    task = state.check()
    wait_for(slow_grading.exists)
    task.stop()
    assert task.wait(20) and task.stopped


@pytest.fixture
def reviewed(tmp_path: Path) -> GradingState:
    """A session beside a graded batch in `out`, with its assignment in `task`."""
    made(tmp_path, grade("ada", score=20.0), grade("ben"), words="student,section\nada,A\nben,B\n")
    state = GradingState(Session(tmp_path))
    for name, value in {"assignment": "task", "out": "out"}.items():
        state.choices.set(name, value)
    return state


def say(state: GradingState, **said: Any) -> str:
    for name, value in said.items():
        state.choices.set(name, value)
    return state.review()


def test_what_an_entry_lacks_is_said(reviewed: GradingState) -> None:
    for said, fault in (
        ({"student": "ada", "points": "3"}, "name yourself"),
        ({"by": "ann", "student": ""}, "name the student, or the section"),
        ({"student": "ada", "section": "A"}, "name the student, or the section"),
        ({"section": "", "points": ""}, "give Points"),
        ({"kind": "extend"}, "give Days"),
        ({"kind": "undo"}, "give Entry"),
        ({"kind": "comment"}, "write a comment"),
    ):
        with pytest.raises(InputError, match=fault):
            say(reviewed, **said)
    assert not reviewed.finished().review.entries


def test_each_kind_of_entry_is_kept_and_changes_the_grade(reviewed: GradingState) -> None:
    def of(student: str) -> Grade:
        return next(each for each in reviewed.finished().grades if each.student == student)

    before = of("ada").criteria[0].score
    name = of("ada").criteria[0].name
    said = say(reviewed, by="ann", student="ada", criterion=name, points=before + 1.0, comment="The plot explains it.")
    assert "entry 1 is kept: points of ada" in said and of("ada").criteria[0].score == before + 1.0
    say(reviewed, by="bob", points=before)
    assert [row[2] for row in waiting(reviewed.finished())] == ["graders differ"]
    say(reviewed, by="cy", points=before, final=True)
    assert not waiting(reviewed.finished())
    # what another kind does not use stays in its field, and counts for nothing
    say(reviewed, kind="excuse", why="ill")
    assert of("ada").status is Status.EXCUSED
    assert "entry 4" in say(reviewed, kind="undo", entry="4") and of("ada").status is Status.OK
    say(reviewed, kind="extend", student="", section="B", days="2")
    assert of_review(of("ben"))["extension_days"] == 2.0 and not of_review(of("ada"))["extension_days"]
    trail = log(reviewed.finished())
    assert [row[3] for row in trail] == ["points", "points", "points", "excuse (undone)", "undo", "extend"]
    assert [row[2] for row in trail[:3]] == ["ann", "bob", "cy"] and trail[3][5] == ""


def test_the_best_attempt_is_a_batch_of_its_own(reviewed: GradingState, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="folders of the other attempts"):
        reviewed.best()
    shutil.copytree(tmp_path / "out", tmp_path / "first")
    reviewed.choices.set("attempts", "first, ")
    with pytest.raises(InputError, match="name the new folder"):
        reviewed.best()
    reviewed.choices.set("new", "best")
    task = reviewed.best()
    assert task.wait(60) and task.error is None and "the best of 2 attempts" in str(task.result)
    reviewed.choices.set("out", "best")
    assert [each.student for each in reviewed.finished().grades] == ["ada", "ben"]


@pytest.mark.skipif(available() is not None, reason=str(available()))
def test_a_batch_is_graded_again_by_a_mended_assignment(tmp_path: Path) -> None:
    assignment_in(tmp_path / "task", HEAD + SINE + RMS)
    put(tmp_path / "in", {"ada.py": law(8.0)})
    run_batch(tmp_path / "task", tmp_path / "in", tmp_path / "out", jobs=1)
    assignment_in(tmp_path / "task", HEAD + SINE + RMS.replace("none = 0.5", "none = 5.0"))
    state = GradingState(Session(tmp_path))
    for name, value in {"assignment": "task", "out": "out", "new": "again", "jobs": 1}.items():
        state.choices.set(name, value)
    task = state.regrade()
    assert task.wait(120) and task.error is None and task.result == 1
    ((change,), left) = state.regraded()
    assert change.student == "ada" and change.now > change.before and left == 0 and "bands are others" in change.why[0]
