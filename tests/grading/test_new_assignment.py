"""`rds grade new`: an assignment of each kind that passes its check as it is made."""

from __future__ import annotations

from pathlib import Path

import pytest

from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.assignment_file import READERS
from rds.grading.assignment.check_assignment import check_assignment
from rds.grading.assignment.hand_out import hand_out
from rds.grading.assignment.new import new_assignment
from rds.grading.assignment.trusted import TrustedFiles
from rds.grading.batch.grade_one import grade
from rds.grading.sandbox import Pool


@pytest.mark.parametrize("kind", READERS)
def test_a_new_assignment_passes_its_check(tmp_path: Path, kind: str, pool: Pool) -> None:
    folder = tmp_path / "my-first"
    new_assignment(folder, kind)
    read = read_assignment(folder)
    assert read.title == "My first" and "# My first" in (folder / "handout.md").read_text()
    # a controller is tried with twenty designs: without walls in half the time, and with the same numbers
    found = check_assignment(read, TrustedFiles() if kind == "controller" else pool, seeds=2)
    assert found.ok, found.faults
    solution = read.path(read.solution)
    assert solution is not None and grade(read, solution, "student 1", pool).score == read.max_score
    assert not [note for note in found.notes if "template" in note or "noise" in note]
    hand_out(read, tmp_path / "students")


def test_secrets_differ_and_nothing_is_written_over(tmp_path: Path) -> None:
    for name in ("a", "b"):
        new_assignment(tmp_path / name, "functions", title='An "odd" title')
    one, other = (read_assignment(tmp_path / name) for name in ("a", "b"))
    assert one.secret != other.secret and one.title == 'An "odd" title'
    new_assignment(tmp_path / "c", "functions", title="THE TITLE of SECRET")  # the words that stand for both
    assert read_assignment(tmp_path / "c").title == "THE TITLE of SECRET"
    with pytest.raises(InputError, match="there already"):
        new_assignment(tmp_path / "a", "functions")
    with pytest.raises(InputError, match="must be one of"):
        new_assignment(tmp_path / "c", "poem")
