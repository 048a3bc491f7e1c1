"""docs/part-programs.md: its files, commands and code do what it says."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from documents import Block, blocks, save
from typer.testing import CliRunner

from rds.cli.main import app
from rds.cli.nc_options import DIALECT
from rds.nc.compiled_file import MAGIC
from rds.nc.validation import Validation
from tests.nc.rs274 import PROGRAMS

BLOCKS = blocks("docs/part-programs.md")
TEXT = (PROGRAMS.parents[2] / "docs" / "part-programs.md").read_text(encoding="utf-8")


def commands(block: Block) -> Iterator[tuple[list[str], list[str]]]:
    """Each command with the lines that are shown of its output."""
    parts = block.text.split("$ rds ")
    assert not parts[0]
    for part in parts[1:]:
        command, *shown = part.splitlines()
        yield shlex.split(command), shown


def test_commands_and_code_do_what_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save(BLOCKS, tmp_path)
    ran = 0
    for block in BLOCKS:
        if block.language == "console":
            for command, shown in commands(block):
                done = CliRunner().invoke(app, command)
                assert done.exit_code == ("bad.ngc" in command), done.stdout
                printed = done.stdout.splitlines()
                assert set(shown) <= set(printed)
                if "bad.ngc" in command:
                    assert shown == printed
                ran += 1
        elif block.words == "run":
            exec(compile(block.text, "part-programs.md", "exec"), {})
            ran += 1
    assert ran == 7
    assert {"part.dat", "part-path.png", "part-proof.png"} <= {path.name for path in tmp_path.iterdir()}


def test_every_key_and_option_is_named() -> None:
    keys = {*Validation("", "").to_json(), "compiled", "proof", "pictures"}
    assert all(f"`{key}`" in TEXT for key in keys)
    assert all(f"| `{name}` |" in TEXT for name in DIALECT)
    assert f"`{MAGIC.decode().strip()}`" in TEXT
