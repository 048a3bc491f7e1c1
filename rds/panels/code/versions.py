"""The versions of a file: its text at every run, what changed since the last one, and back to any of them.

They lie in `.versions/` in the folder of the user's files, one line of JSON each: a line that is damaged is left out.
"""

from __future__ import annotations

import contextlib
import difflib
import hashlib
import json
import os
import time
from dataclasses import dataclass
from pathlib import Path

from rds.core.private_files import make_folder, open_descriptor

FOLDER = ".versions"
LARGEST_FILE = 1 << 20  # bytes of a file of which versions are kept
LARGEST = 8 << 20  # bytes of all versions of a file that are read: the latest count


@dataclass(frozen=True)
class Version:
    """One text that a file had when something ran; `run` says what, in words or by the name of the run's folder."""

    when: float  # s since 1970
    run: str
    text: str

    @property
    def digest(self) -> str:
        """By which equal texts are known."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def keep(folder: Path, name: str, text: str, run: str) -> bool:
    """Keep the text that the file `name` of `folder` has for this run; false where it is that of the last one.

    A folder that cannot be written to keeps nothing: a run never fails because of its versions.
    """
    before = versions(folder, name)
    if before and before[0].text == text:
        return False
    line = json.dumps({"when": time.time(), "run": run, "text": text}) + "\n"
    with contextlib.suppress(OSError):
        path = _path(folder, name)
        make_folder(path.parent)
        descriptor = open_descriptor(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, is_own=True)
        try:
            os.write(descriptor, line.encode())
        finally:
            os.close(descriptor)
        return True
    return False


def keep_file(path: Path, run: str) -> None:
    """Keep a Python file as it is now; any other file, and one that cannot be read, is left alone."""
    if path.suffix != ".py":
        return
    with contextlib.suppress(OSError):
        if path.stat().st_size <= LARGEST_FILE:
            keep(path.parent, path.name, path.read_text(encoding="utf-8", errors="replace"), run)


def versions(folder: Path, name: str) -> list[Version]:
    """What was kept of the file `name`, the latest first."""
    try:
        with _path(folder, name).open("rb") as stream:
            stream.seek(0, os.SEEK_END)
            stream.seek(max(stream.tell() - LARGEST, 0))
            lines = stream.read().splitlines()
    except OSError:
        return []
    found = []
    for line in lines:
        with contextlib.suppress(ValueError, KeyError, TypeError):
            said = json.loads(line)
            found.append(Version(float(said["when"]), str(said["run"]), str(said["text"])))
    return found[::-1]


def changes(before: str, after: str) -> list[tuple[str, str]]:
    """The lines that differ, with two around each: ("+" new, "-" gone, " " the same, "@" a gap, text)."""
    lines = list(difflib.unified_diff(before.splitlines(), after.splitlines(), lineterm="", n=2))[2:]
    return [("@", line.strip("@ ")) if line.startswith("@@") else (line[:1], line[1:]) for line in lines]


def change_sentence(before: str, after: str) -> str:
    """How many lines are new and gone."""
    signs = [sign for sign, _ in changes(before, after)]
    new, gone = signs.count("+"), signs.count("-")
    return f"+{new} −{gone} lines" if new or gone else "the same"


def _path(folder: Path, name: str) -> Path:
    return folder / FOLDER / f"{name}.jsonl"
