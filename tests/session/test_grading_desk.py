"""What the grading panel needs without a batch; a whole batch is graded in tests/grading and in the browser."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.grading.grade import Grade, Status
from rds.session import Session
from rds.session.grading_desk import GradingDesk, progress, rows


def test_progress_is_what_the_journal_has(tmp_path: Path) -> None:
    assert progress(tmp_path) == (0, 0)
    (tmp_path / "batch.json").write_text(json.dumps({"handed_in": {"a": "1", "b": "2", "c": "3"}}))
    assert progress(tmp_path) == (0, 3)
    (tmp_path / "journal.jsonl").write_text("{}\n{}\nhalf a li")
    assert progress(tmp_path) == (2, 3)
    (tmp_path / "batch.json").write_text("[")
    assert progress(tmp_path) == (0, 0)


def test_what_is_missing_is_said_at_once(tmp_path: Path) -> None:
    desk = GradingDesk(Session(tmp_path))
    with pytest.raises(InputError, match="name the assignment's folder"):
        desk.grade()
    desk.choices.set("assignment", "a")
    with pytest.raises(InputError, match="name the folder of submissions"):
        desk.grade()
    desk.choices.set("submissions", "s")
    with pytest.raises(InputError, match="name the folder for grades"):
        desk.grade()
    assert not desk.started()


def test_an_assignment_that_is_not_there_is_the_task_s_error(tmp_path: Path) -> None:
    desk = GradingDesk(Session(tmp_path))
    for name in ("assignment", "submissions", "out"):
        desk.choices.set(name, name)
    task = desk.grade()
    assert task.wait(120) and isinstance(task.error, InputError) and "assignment" in str(task.error)


def test_the_worst_come_first() -> None:
    def grade(student: str, score: float) -> Grade:
        return Grade(student, Status.OK, "", score, 10.0, score, ())

    assert [row[0] for row in rows([grade("ada", 10.0), grade("zoe", 0.0), grade("ben", 0.0)])] == ["ben", "zoe", "ada"]
