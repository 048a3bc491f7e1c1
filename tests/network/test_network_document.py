"""docs/network.md: its files, commands and Python work, in their order."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from documents import blocks, save
from typer.testing import CliRunner

from rds.cli.main import app


@pytest.mark.realtime
def test_its_files_commands_and_python_work(alone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = blocks("docs/network.md")
    save(found, alone)
    ran = 0
    for block in found:
        for line in block.text.splitlines() if block.language == "sh" else ():
            words = shlex.split(line)
            assert words[0] == "rds"
            told = CliRunner().invoke(app, words[1:])
            assert told.exit_code == 0, f"{line}: {told.output}"
            ran += 1
    assert ran >= 5
    (python,) = (block for block in found if block.language == "python")
    exec(compile(python.text, "docs/network.md", "exec"), {})
    assert [line.split(":")[0].split()[0] for line in capsys.readouterr().out.splitlines()[-3:]] == [
        "drift",
        "without",
        "with",
    ]
