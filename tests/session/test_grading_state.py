"""What the grading panel needs without a batch; a whole batch is graded in tests/grading and in the browser."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rds.core.errors import InputError
from rds.grading.grade import Grade, Status
from rds.panels.grading.state import GradingState, _said, progress, rows
from rds.panels.session import Session
from tests.grading.grades import batch_in, grade


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


def until(there: Callable[[], object]) -> None:
    deadline = time.monotonic() + 20.0
    while not there():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_batch_goes_on_without_its_page_and_another_finds_and_stops_it(slow_grading: Path, tmp_path: Path) -> None:
    state = GradingState(Session(tmp_path))
    assert state.going_on() is None
    for name in ("assignment", "submissions", "out"):
        state.choices.set(name, name)
    first = state.grade()
    until(slow_grading.exists)
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
    until(slow_grading.exists)
    task.stop()
    assert task.wait(20) and task.stopped


def test_words_of_a_grader_are_kept_with_their_name(tmp_path: Path) -> None:
    state = GradingState(Session(tmp_path))
    batch_in(tmp_path / "out", [grade("ada")])
    state.choices.set("out", "out")
    with pytest.raises(InputError, match="name the student"):
        state.review()
    for name, value in {"student": "ada", "by": "ann"}.items():
        state.choices.set(name, value)
    with pytest.raises(InputError, match="points of a criterion, or a comment"):
        state.review()
    state.choices.set("comment", "See me, please.")
    with pytest.raises(InputError, match="cannot be read any more"):  # this batch has no assignment to make pages by
        state.review()
