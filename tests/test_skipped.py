"""What a run has skipped is told at its end, with the command that includes it."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import skipped
from panels.conftest import HOW

from rds.grading.sandbox import requirements

HERE = Path(__file__).parent
SAMPLE = """
import pytest

@pytest.mark.skipif(True, reason="bubblewrap is missing, and submissions are run in nothing else")
@pytest.mark.parametrize("number", range(3))
def test_sandbox(number):
    pass

def test_browser():
    pytest.skip("no Chromium here")

def test_system():
    pytest.skip("no /proc here")

def test_runs():
    pass
"""
FILE = 'import pytest\npytest.importorskip("no_such_package")\n\ndef test_it():\n    pass\n'


def run(place: Path, *options: str) -> str:
    (place / "test_sample.py").write_text(SAMPLE)
    (place / "test_file.py").write_text(FILE)
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "skipped", "-p", "no:cacheprovider", *options],
        cwd=place,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(HERE)},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("options", [(), ("-n", "2")], ids=["alone", "side by side"])
def test_the_end_says_how_many_why_and_which_command_includes_them(tmp_path: Path, options: tuple[str, ...]) -> None:
    out = run(tmp_path, *options)
    title, _, rest = out.partition("skipped: 6 tests and files of tests")
    assert rest, title
    assert re.findall(r"^ +(\d+)  (.*)\n +(.*)$", rest, re.MULTILINE) == [
        ("3", "bubblewrap is missing, and submissions are run in nothing else", said(skipped.REMEDIES, "bubblewrap")),
        ("1", "could not import 'no_such_package': No module named 'no_such_package'", "include them: make setup"),
        ("1", "no /proc here", skipped.NOT_FOR_THIS_COMPUTER),
        ("1", "no Chromium here", "include them: sudo apt install chromium"),
    ]
    *_, last, _ = rest.strip().splitlines()
    assert last == (
        "All that can be installed, then: sudo apt install bubblewrap libseccomp2 && make setup && "
        "sudo apt install chromium && make test"
    )


def said(remedies: dict[str, str], part: str) -> str:
    return "include them: " + next(command for pattern, command in remedies.items() if part in pattern)


def test_nothing_is_said_where_nothing_was_skipped(tmp_path: Path) -> None:
    out = run(tmp_path, "test_sample.py::test_runs")
    assert "1 passed" in out and "skipped" not in out


def test_the_reasons_of_the_sandbox_and_of_the_browser_have_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requirements.shutil, "which", lambda _: None)
    assert skipped.remedy(requirements.missing() or "") == "sudo apt install bubblewrap libseccomp2"
    assert skipped.remedy(HOW) == "sudo apt install chromium"
