"""Submissions that are no files: refused without being waited for, and the next one is graded as ever."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

import pytest

from rds.grading.grade import Status
from rds.grading.sandbox import Pool
from tests.grading.attacked import HONEST, run
from tests.grading.attacks import PATIENT, SHORT

Written = Callable[..., Path]


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(os.path.relpath(path))


PLACES: dict[str, Callable[[Path], object]] = {
    "a link to a secret": lambda path: path.symlink_to("/etc/passwd"),
    "a link to itself": lambda path: path.symlink_to(path),
    "a link to a device": lambda path: path.symlink_to("/dev/zero"),
    "a FIFO": os.mkfifo,
    "a folder": Path.mkdir,
    "a socket": _socket,
    "a file of a gigabyte": lambda path: (path.touch(), os.truncate(path, 1 << 30)),
}


@pytest.mark.parametrize("name", PLACES)
def test_what_is_no_file_is_refused(
    name: str, pool: Pool, written: Written, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "submission_of_somebody.py"
    before = run(pool, written(HONEST, ""), PATIENT)
    PLACES[name](path)
    found = run(pool, path, SHORT)
    assert (found.status, found.answers) == (Status.REFUSED, [])
    assert found.reason
    assert run(pool, written(HONEST, ""), PATIENT) == before


@pytest.mark.parametrize("name", ["a\nb.py", "\x1b[2J.py", "-rf.py", "$(id).py", "a'; import os.py", "é\u202e.py"])
def test_a_name_is_only_a_name(name: str, pool: Pool, written: Written) -> None:
    found = run(pool, written("raise ValueError(__file__)", "", name), SHORT)
    assert found.status is Status.FAILED_TO_LOAD
    assert "submission.py" in found.reason
    assert found.reason.isprintable()
