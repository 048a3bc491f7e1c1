"""docs/bus.md: its Python runs, and its commands have the options that they are shown with."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from documents import ROOT, blocks
from typer.main import get_command

from bus_tools.made_frames import frame
from rds.bus.tools.logs import ENDINGS, LogWriter
from rds.cli.bus import app

DOCUMENT = "docs/bus.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")
TOOLS = {"monitor", "record", "replay", "serve-socketcand"}
SHOWN = [line.split("#")[0].split()[2:] for line in TEXT.splitlines() if line.startswith("rds bus ")]


@pytest.mark.parametrize("block", [block.text for block in blocks(DOCUMENT) if "from rds.bus" in block.text])
def test_python_runs(block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = LogWriter(tmp_path / "run.log")
    for k in range(5):
        log.write(frame(0x21, bytes(8), k / 100))
    log.close()
    done = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("words", [words for words in SHOWN if words[0] in TOOLS], ids=" ".join)
def test_commands_have_the_options_that_are_shown(words: list[str]) -> None:
    command = get_command(app).commands[words[0]]  # type: ignore[attr-defined]
    known = {option for parameter in command.params for option in parameter.opts}
    assert set(re.findall(r"--[\w-]+", " ".join(words))) <= known


def test_every_command_and_format_is_there() -> None:
    assert {words[0] for words in SHOWN} >= TOOLS
    assert all(f"`{ending}`" in TEXT for ending in ENDINGS)
