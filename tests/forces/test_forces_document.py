"""docs/forces.md: its files and commands work in their order, and its tables are those of the program."""

from __future__ import annotations

import re
import shlex

import pytest
from documents import ROOT, blocks, save
from typer.testing import CliRunner

from rds.cli.main import app
from rds.machines.forces.cut_file import CUT
from rds.machines.forces.force_law import COEFFICIENTS, coefficient_names, force_law

TEXT = (ROOT / "docs/forces.md").read_text()


def test_its_files_and_commands_work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = blocks("docs/forces.md")
    save(found, tmp_path)
    ran = 0
    for block in found:
        for line in block.text.splitlines() if block.language == "sh" else ():
            words = shlex.split(line)
            assert words[0] == "rds"
            told = CliRunner().invoke(app, words[1:])
            assert told.exit_code == (1 if "exit=1" in block.words else 0), f"{line}: {told.output}"
            ran += 1
    assert ran == 6
    assert force_law("mine", "mine.toml").feed == pytest.approx(0.75, abs=0.02)


def test_every_key_is_in_a_table():
    for table in (CUT, COEFFICIENTS):
        for key in table.keys:
            assert f"`{key}`" in TEXT, key


@pytest.mark.parametrize("name", coefficient_names())
def test_the_coefficients_are_those_of_the_data(name):
    row = re.search(rf"^\| `{name}` \| (\S+) \| (\S+) \| (\S+) \| (\S+) \|", TEXT, re.MULTILINE)
    assert row is not None
    law = force_law(name)
    K, depth, speed, feed = map(float, row.groups())
    assert (law.K, law.depth, law.speed, law.feed) == pytest.approx((K, depth, speed, feed), rel=1e-3)
