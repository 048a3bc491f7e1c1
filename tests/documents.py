"""Documents as tests see them: fenced blocks of Markdown, and commands run as their reader would."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
REAL_TIME = ("emulation", "implementation", "system-test", "model-validation")
_FENCE = re.compile(r"^```(\S+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block: its language, the words after it (`file=NAME`, `run`, ...), its text."""

    language: str
    words: str
    text: str

    @property
    def file(self) -> str | None:
        """The file that the reader is told to save it as."""
        found = re.search(r"file=(\S+)", self.words)
        return found[1] if found else None


def blocks(document: str) -> list[Block]:
    """The fenced blocks of a document of the project, in order."""
    text = (ROOT / document).read_text(encoding="utf-8")
    return [Block(language, words.strip(), body) for language, words, body in _FENCE.findall(text)]


def save(found: list[Block], folder: Path) -> list[Path]:
    """Save every block that has a file's name."""
    saved = []
    for block in found:
        if block.file:
            saved.append(folder / block.file)
            saved[-1].write_text(block.text, encoding="utf-8")
    return saved


def shorten(experiment: Path, duration: float) -> None:
    """Give an experiment file another duration, s: real-time runs take as long as they say."""
    text, changes = re.subn(r"(?m)^duration = \S+", f"duration = {duration}", experiment.read_text(encoding="utf-8"))
    assert changes == 1
    experiment.write_text(text, encoding="utf-8")


def run(program: list[str], timeout: float = 120.0) -> subprocess.CompletedProcess[str]:
    """Run `python PROGRAM...` where the test is, and return what it did."""
    return subprocess.run(
        [sys.executable, *program],
        env=environment(),
        capture_output=True,
        encoding="utf-8",
        stdin=subprocess.DEVNULL,
        timeout=timeout,
    )


def environment() -> dict[str, str]:
    """That of a user whose terminal shows all characters."""
    return dict(os.environ, PYTHONIOENCODING="utf-8", MPLBACKEND="agg")


def is_real_time(arguments: list[str]) -> bool:
    """Whether `rds run ...` runs against the clock."""
    if "--mode" in arguments:
        return arguments[arguments.index("--mode") + 1] in REAL_TIME
    text = Path(arguments[1]).read_text(encoding="utf-8")
    return any(f'mode = "{mode}"' in text for mode in REAL_TIME)
