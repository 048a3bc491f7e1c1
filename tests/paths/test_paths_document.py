"""docs/paths.md: its files, commands and code do what it says, and every option is named."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from documents import ROOT, blocks, save
from typer.testing import CliRunner

from rds.cli.main import app
from tests.nc.test_part_programs_document import commands
from tests.paths.programs import agreed

DOCUMENT = "docs/paths.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")


def test_commands_and_code_do_what_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    found = blocks(DOCUMENT)
    save(found, tmp_path)
    ran = 0
    for block in found:
        if block.language == "console":
            for command, shown in commands(block):
                done = CliRunner().invoke(app, command)
                assert done.exit_code == 0, f"{command}: {done.output}"
                assert set(shown) <= set(done.stdout.splitlines()), f"{command}: {done.stdout}"
                ran += 1
        elif block.words == "run":
            exec(compile(block.text, DOCUMENT, "exec"), {})
            ran += 1
    assert ran == 14
    program, said = capsys.readouterr().out.split("M2\n")
    agreed(f"{program}M2\n")
    assert re.search(r"0\.\d{3} mm of 0\.4 mm", said)
    for made in tmp_path.glob("*.ngc"):
        agreed(made.read_text())
    assert (tmp_path / "key.png").read_bytes().startswith(b"\x89PNG")


def test_a_drawing_becomes_a_part_as_its_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = blocks("docs/from-drawing-to-part.md")
    save(page, tmp_path)
    called = [command for block in page if block.language == "console" for command in commands(block)]
    assert [command[1] for command, _ in called] == ["make", "make", "check", "plot", "time", "cut", "run", "cut"]
    for command, shown in called:
        done = CliRunner().invoke(app, command)
        compared = "--measured" in command
        assert done.exit_code == compared, f"{command}: {done.output}"
        assert set(shown) <= set(done.stdout.splitlines()), f"{command}: {done.stdout}"
        if compared:
            volumes = re.findall(r"(?:left above|cut below) the part: ([\d.]+) mm³", done.stdout)
            assert len(volumes) == 2 and all(0.0 < float(volume) < 20.0 for volume in volumes), done.stdout
    agreed((tmp_path / "plate.ngc").read_text())


def test_every_option_is_named() -> None:
    named = set(re.findall(r"--[a-z-]+", TEXT))
    for command in ("line", "quad", "arc", "cone", "points", "outline", "job"):
        shown = (
            CliRunner().invoke(app, ["nc", "make", command, "--help"], env={"COLUMNS": "200", "TERM": "dumb"}).stdout
        )
        options = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", shown)) - {"--help"}
        assert options and options <= named, options - named
