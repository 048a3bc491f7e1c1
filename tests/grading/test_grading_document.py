"""docs/grading.md: an instructor who follows it gets what it says; docs/grading-setup.md names files that are there."""

from __future__ import annotations

import csv
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.grading.exports import GRADEBOOKS
from rds.grading.exports.exported import ExportOptions
from rds.grading.grade import Status
from rds.grading.sandbox import available
from tests.documents import ROOT, blocks

GUIDE, SETUP = "docs/grading.md", "docs/grading-setup.md"
TEXT = (ROOT / GUIDE).read_text(encoding="utf-8")


def test_every_gradebook_option_and_status_is_named() -> None:
    for name in GRADEBOOKS.names():
        assert f"`{name}" in TEXT and f"--to {name}" in TEXT
    for option in ExportOptions.__dataclass_fields__:
        assert f"`--{option}`" in TEXT
    for status in Status:
        assert str(status) in TEXT


@pytest.mark.skipif(available() is not None, reason=str(available()))
def test_its_commands_do_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = blocks(GUIDE)
    for block in found:
        if block.file:
            Path(block.file).parent.mkdir(parents=True, exist_ok=True)
            Path(block.file).write_text(block.text, encoding="utf-8")
    commands = [line[2:] for b in found if b.language == "console" for line in b.text.splitlines()]
    assert len(commands) == 11
    for command in commands:
        done = CliRunner().invoke(app, shlex.split(command)[1:])
        assert done.exit_code == 0, f"{command}\n{done.output}"
    named = re.findall(r"^\| `([\w./]+(?:html|csv|json|jsonl))`", TEXT, re.MULTILINE)
    assert {"index.html", "grades.csv", "batch.json"} <= {*named}
    for name in named:
        assert (Path("grades") / name.replace("NAME", "bob")).is_file(), name
    ada, bob = csv.DictReader(Path("grades/grades.csv").read_text(encoding="utf-8-sig").splitlines())
    assert ada["score"] == "40" and 0.0 < float(bob["score"]) < 40.0
    page = Path("grades/students/bob/feedback.html").read_text()
    assert "bob was here" in page and "A sine of 2 mm" in page and "Hidden cases, not shown: 1" in page
    canvas = csv.DictReader(Path("grades/canvas.csv").read_text().splitlines())
    assert [float(row["Tracking (77)"]) for row in canvas] == [40.0, 40.0, pytest.approx(float(bob["score"]))]


def test_files_of_the_set_ups_are_there() -> None:
    text = (ROOT / SETUP).read_text(encoding="utf-8")
    for name in (
        "nbgrader/nbgrader_config.py",
        "gradescope/setup.sh",
        "gradescope/run_autograder",
        "prairielearn/run.sh",
    ):
        assert name.rpartition("/")[2] in text
        assert (ROOT / "examples" / "grading-setups" / name).is_file()
    assert "CriteriaExportPlugin" in text
