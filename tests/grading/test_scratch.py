"""Folders for a while: gone with their end, and after a kill with the next one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

pytest.importorskip("fcntl")

from rds.grading.batch.scratch import scratch

HOLDER = """
import sys
from rds.grading.batch.scratch import scratch
with scratch("solution") as folder:
    (folder / "submission.py").write_text("secret")
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The system's temporary folder, for this test."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_it_is_gone_afterwards_and_only_its_owner_can_read_it(place: Path) -> None:
    with pytest.raises(KeyError), scratch("check") as folder:
        (folder / "inside").mkdir()
        assert folder.parent == place and folder.stat().st_mode & 0o077 == 0
        raise KeyError
    assert list(place.iterdir()) == []


def test_what_a_killed_grader_left_is_removed_and_that_of_a_living_one_is_not(place: Path) -> None:
    command = [sys.executable, "-c", HOLDER]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        held = Path(process.stdout.readline().strip())
        with scratch("check"):
            assert (held / "submission.py").read_text() == "secret"
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert held.exists()
        with scratch("check") as folder:
            assert list(place.iterdir()) == [folder]


def test_what_is_not_its_own_is_left_alone(place: Path) -> None:
    mine = place / "elsewhere"
    mine.mkdir()
    (place / "rds-grading-link").symlink_to(mine)
    (place / "rds-grading-file").write_text("")
    os.mkfifo(place / "rds-grading-pipe")
    before = sorted(place.iterdir())
    with scratch("check"):
        pass
    assert sorted(place.iterdir()) == before
