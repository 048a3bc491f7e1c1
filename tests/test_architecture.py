"""docs/architecture.md is true: its map has every folder, its paths exist, and who adds a part needs no other file."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from added_parts import PARTS, Part
from documents import ROOT
from grading.grades import batch_in, grade

pytestmark = pytest.mark.realtime  # the dialect's run

TEXT = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PROSE = re.sub(r"(?ms)^```.*?^```$", "", TEXT)
IN_CODE = re.compile(r"`([^`]+)`")


def section(title: str) -> str:
    """The text below a heading, up to the next one."""
    return TEXT.split(f"\n## {title}\n")[1].split("\n## ")[0]


def rows(title: str) -> list[list[str]]:
    """The cells of the table in a section, without its head."""
    lines = [line for line in section(title).splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


TO_ADD = {
    re.sub(r"^an? ", "", kind): {*IN_CODE.findall(new), *IN_CODE.findall(named)}
    for kind, new, named in rows("To add something")
}


def test_the_map_has_every_folder_and_no_other() -> None:
    folders = {f"{path.parent.relative_to(ROOT)}/" for path in (ROOT / "rds").rglob("__init__.py")} - {"rds/"}
    assert {name for cell, _ in rows("The rooms") for name in IN_CODE.findall(cell)} == folders


def test_contributing_names_every_room() -> None:
    named = set(re.findall(r"(?m)^    rds/(\w+)/ ", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")))
    assert named == {path.parent.name for path in (ROOT / "rds").glob("*/__init__.py")}


def test_the_paths_that_it_names_exist() -> None:
    named = {name for name in IN_CODE.findall(PROSE) if re.match(r"(rds|tests)/", name) and "NAME" not in name}
    assert len(named) > 60
    assert not [name for name in named if not (ROOT / name).exists()]


def test_own_code_beside_a_library_says_why_in_its_docstring() -> None:
    for file, _, why in rows("Own code beside a library"):
        (name,) = IN_CODE.findall(file)
        said = ast.get_docstring(ast.parse((ROOT / name).read_text(encoding="utf-8"))) or ""
        assert why in " ".join(said.split()), name


def test_the_modes_are_those_of_its_table() -> None:
    from rds.modes import load_mode, mode_names

    lines = [line.split("|") for line in section("The idea").splitlines() if line.startswith("| `")]
    table = {IN_CODE.findall(cells[1])[0]: cells for cells in lines if cells[2].strip() in ("real", "virtual")}
    assert list(table) == mode_names()
    for name, cells in table.items():
        mode = load_mode(name)
        assert cells[2].strip() == ("real" if mode.real_time else "virtual"), name
        assert cells[6].strip() == " or ".join(f"{drive}s" for drive in mode.drives), name


def test_there_is_a_part_of_each_kind() -> None:
    assert list(PARTS) == list(TO_ADD)


@pytest.mark.parametrize("kind", PARTS)
def test_a_part_touches_the_files_that_the_document_names_and_no_other(kind: str) -> None:
    assert set(PARTS[kind].files) == TO_ADD[kind]


def add(part: Part, checkout: Path) -> None:
    """Touch the files of a part."""
    for name, content in part.files.items():
        file = checkout / name.replace("NAME", part.name.replace("-", "_"))
        if isinstance(content, str):
            assert not file.exists()
            file.parent.mkdir(exist_ok=True)
            file.write_text(content, encoding="utf-8")
            continue
        lines = file.read_text(encoding="utf-8").splitlines()
        for after, new in content:
            (place,) = [number for number, line in enumerate(lines) if line.startswith(after)]
            lines.insert(place + 1, new)
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")


USE_ALL = """
import json, os, sys, traceback
from pathlib import Path
import rds
assert Path(rds.__file__).is_relative_to(sys.argv[1]), rds.__file__
for kind, use in json.loads(sys.stdin.read()).items():
    said = {}
    try:
        exec(use, said)
        answer = repr(said["found"])
    except BaseException:
        answer = traceback.format_exc()
    print("answer", json.dumps([kind, answer]), flush=True)
from typer.testing import CliRunner
from rds.cli.main import app
for kind, words in json.loads(sys.argv[2]).items():
    said = CliRunner().invoke(app, words, env={"COLUMNS": "400", "NO_COLOR": "1"}).output
    print("answer", json.dumps(["--help " + kind, said]), flush=True)
"""
LISTED = {  # what lists the parts of each kind
    "": ["library", "--markdown"],
    "interpolator": ["interpolate", "--help"],
    "acceleration filter": ["interpolate", "--help"],
    "mode": ["run", "--help"],
    "dialect": ["machine", "serve", "--help"],
    "format of bus logs": ["bus", "record", "--help"],
    "format of logged data": ["data", "describe", "--help"],
    "report": ["report", "--help"],
    "gradebook": ["grade", "export", "--help"],
}


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What comes of using each part, in a copy of the checkout that has them all."""
    checkout, work = tmp_path_factory.mktemp("checkout"), tmp_path_factory.mktemp("work")
    shutil.copytree(ROOT / "rds", checkout / "rds")
    for part in PARTS.values():
        add(part, checkout)
    batch_in(work / "batch", [grade()])
    done = subprocess.run(
        [sys.executable, "-c", USE_ALL, str(checkout), json.dumps(LISTED)],
        input=json.dumps({kind: part.use for kind, part in PARTS.items()}),
        cwd=work,
        env=os.environ | {"PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return dict(json.loads(line[7:]) for line in done.stdout.splitlines() if line.startswith("answer "))


@pytest.mark.parametrize("kind", PARTS)
def test_a_part_that_was_added_works(kind: str, answers: dict[str, str]) -> None:
    assert answers[kind] == PARTS[kind].expected


@pytest.mark.parametrize("kind", [kind for kind in PARTS if kind != "command"])
def test_a_part_that_was_added_is_in_the_document_of_the_library_without_another_edit(
    kind: str, answers: dict[str, str]
) -> None:
    assert PARTS[kind].name in answers["--help "]


@pytest.mark.parametrize("kind", [kind for kind in LISTED if kind])
def test_a_part_that_was_added_is_named_by_its_command_s_help(kind: str, answers: dict[str, str]) -> None:
    assert PARTS[kind].name in answers[f"--help {kind}"]
