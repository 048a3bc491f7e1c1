"""The first ten programs of a course: each is checked, timed and cut, and its typical fault is told."""

from __future__ import annotations

import json
import re
from math import pi, radians, tan
from pathlib import Path

import pytest
from documents import ROOT
from typer.testing import CliRunner

from rds.cli.main import app

COURSE = ROOT / "examples" / "course"
TOOLS = str(COURSE / "tools.toml")
BLOCK = "--stock=-30,-20,-10,30,20,0"
DRILL = pi * 2.5**2  # mm²
POINT = 2.5 / tan(radians(59.0))  # mm, of a drill of 5 mm and 118 degrees

# volume in mm³, by its shape where that is simple; what is changed, into what, and what is said then
PROGRAMS = {
    "01-face": (60.0 * 40.0 * 0.5, " F600", "", "no feed rate is set"),
    "02-holes": (6 * DRILL * (10.0 - POINT * 2 / 3), "M3\n", "\n", "spindle"),
    "03-slot": ((40.0 * 4.0 + pi * 4.0) * 4.0, "G0 Z", "G0 X300 Z", "beyond its travel"),
    "04-pocket": ((30.0 * 20.0 - (4.0 - pi) * 4.0) * 6.0, "M98", "M97", "calls part of a program on other controls"),
    "05-contour": (338.0, "G2 X22 Y-20 I-8 J0", "G2 X22 Y-20 I-5 J0", "the arc's end is off its circle"),
    "06-arcs": (1004.0, "\nG2 ", "\nG2 G3 ", "leave one of them"),
    "07-bolt-circle": (8 * DRILL * (6.0 - POINT * 2 / 3), "T3 M6", "T9 M6", "the tool table has no tool 9"),
    "08-letters": (10.7, "G21", "G20", "beyond its travel"),
    "09-turned": (411.0, "G10", "G68", "write G10 L2 P0 R and the angle"),
    "10-plate": (1156.0, "M30", "", "the program does not end"),
}


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, ["nc", *words, "--tools", TOOLS])
    return done.exit_code, done.output


def test_its_page_has_a_row_for_each() -> None:
    rows = re.findall(r"^\| `(\S+)` \|", (COURSE / "README.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert rows == sorted(PROGRAMS) == sorted(file.stem for file in COURSE.glob("*.ngc"))


@pytest.mark.parametrize("name", PROGRAMS)
def test_it_is_checked_timed_and_cut(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.ngc").write_bytes((COURSE / f"{name}.ngc").read_bytes())
    assert run("check", "part.ngc")[0] == 0
    code, said = run("time", "part.ngc")
    assert code == 0, said
    block = [BLOCK] if name in ("01-face", "05-contour") else []
    code, said = run("cut", "part.ngc", "--json", "--cell", "0.1", *block)
    found = json.loads(said)
    assert code == 0, said
    assert sum(tool["volume_mm3"] for tool in found["tools"]) == pytest.approx(PROGRAMS[name][0], rel=0.01)


@pytest.mark.parametrize("name", PROGRAMS)
def test_its_typical_fault_is_told(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    _, old, new, message = PROGRAMS[name]
    text = (COURSE / f"{name}.ngc").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "part.ngc").write_text(text.replace(old, new, 1), encoding="utf-8")
    command = "cut" if name == "02-holes" else "check"
    code, said = run(command, "part.ngc")
    assert code == 1 and message in said, said
