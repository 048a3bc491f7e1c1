"""Submissions, grades and feedback are the grader's alone, also while they are made."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from other_user import SIGN, hall, open_by_mode, seen_by_another

from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.assignment.hand_out import hand_out
from rds.grading.batch.run import run_batch
from rds.grading.exports.export import export
from rds.grading.exports.exported import ExportOptions
from rds.grading.sandbox import available
from rds.modes.loop.plan import load
from tests.grading.batches import ASSIGNMENT, law, put
from tests.grading.made import assignment_in

pytestmark = pytest.mark.skipif(available() is not None, reason=str(available()))


def test_a_batch_and_what_is_made_of_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assignment_in(tmp_path / "task", ASSIGNMENT, law())
    put(tmp_path / "in", {"ada.py": law(), "ben/controller.py": law(10.0), "cy.py": "def control(:\n"})
    found: list[str] = []
    with hall() as place:
        monkeypatch.setenv("TMPDIR", str(place))
        monkeypatch.setattr(tempfile, "tempdir", None)

        def look(done: int, of: int) -> None:
            made = [path for path in place.iterdir() if path.name != SIGN]
            # what lies in a folder that only its user can enter is nobody else's, whatever its own mode
            entered = [path for path in made if not path.name.startswith("rds-grading-")]
            found.extend(open_by_mode(entered))
            if os.getuid() == 0:
                found.extend(seen_by_another(made))

        run_batch(tmp_path / "task", tmp_path / "in", place / "out", jobs=1, progress=look)
        export(place / "out", "nbgrader", place / "scores.csv", ExportOptions(None, None, None))
        export(place / "out", "gradescope", None, ExportOptions(None, None, None))
        hand_out(read_assignment(tmp_path / "task"), place / "copies" / "first")
        look(0, 0)
        assert found == []
        names = {path.name for path in place.rglob("*")}
        assert {"journal.jsonl", "grade.json", "feedback.html", "submission.py", "assignment.toml"} <= names


@pytest.mark.parametrize("mode", [0o620, 0o602])
def test_a_plan_that_others_could_have_written_is_not_read(tmp_path: Path, mode: int) -> None:
    """It is a pickle, and reading it runs what is in it."""
    path = tmp_path / "plan.pkl"
    path.write_bytes(b"cos\nabort\n(tR.")
    path.chmod(mode)
    with pytest.raises(InputError, match="was not written by this run alone"):
        load(path)
