"""docs/data.md: its maps are maps, its example runs, and every key and kind of finding is named."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from documents import ROOT, blocks, save
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.identification.logs.map import LogMap

DOCUMENT = "docs/data.md"
TEXT = (ROOT / DOCUMENT).read_text(encoding="utf-8")
NAMED = set(re.findall(r"`\"?([\w.-]+)\"?`", TEXT)) | set(re.findall(r"[{ ,](\w+)(?= =|, | })", TEXT))


def test_its_maps_are_maps(tmp_path: Path) -> None:
    files = [file for file in save(blocks(DOCUMENT), tmp_path) if file.suffix == ".toml"]
    assert len(files) == 4
    assert all(LogMap.read(file).axes for file in files)


def test_its_example_is_described_and_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    save(blocks(DOCUMENT), tmp_path)
    exec((tmp_path / "make_log.py").read_text(), {})
    done = CliRunner().invoke(app, ["data", "describe", "log.csv", "--map", "log.csv.map.toml", "--json"])
    about = json.loads(done.stdout)
    assert done.exit_code == 0 and about["logs"][0]["quantities"]["current"] == {
        "unit": "A",
        "low": -0.36,
        "high": 0.36,
    }
    words = {*about, *about["columns"][0], *about["logs"][0], *about["logs"][0]["clocks"][0], *about["findings"][0]}
    assert words <= NAMED
    python = next(block.text for block in blocks(DOCUMENT) if block.language == "python" and not block.file)
    exec(python, {})


@pytest.mark.parametrize(
    "text",
    [
        "nokey = 1",
        "[time]\nnokey = 1",
        "[axis.X]\nnokey = 1",
        "[second]\nnokey = 1",
        "[table]\nnokey = 1",
        "[bus]\nnokey = 1",
    ],
)
def test_every_key_of_a_map_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "map.toml"
    needed = {"[axis.X]": 'command = "u"\nposition = "y"\n', "[second]": 'file = "b.csv"\noffset = 1.0\n'}
    table, _, key = text.partition("\n") if text.startswith("[") else ("", "", text)
    rest = "" if table == "[axis.X]" else '\n[axis.X]\ncommand = "u"\nposition = "y"\n'
    path.write_text(f"{table}\n{needed.get(table, '')}{key}\n{rest}")
    with pytest.raises(InputError) as refusal:
        LogMap.read(path)
    listed = re.search(r"known keys: ([\w, ]+)", str(refusal.value))
    assert listed, str(refusal.value)
    assert set(listed[1].split(", ")) - {"axis", "time", "second", "table", "bus"} <= NAMED


def test_every_kind_of_finding_is_named() -> None:
    kinds = set()
    for file in (ROOT / "rds" / "identification" / "logs").glob("*.py"):
        kinds |= set(re.findall(r"Finding\(\s*\"([\w-]+)\"", file.read_text(encoding="utf-8")))
    assert len(kinds) > 12
    assert kinds <= NAMED
