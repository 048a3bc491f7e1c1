"""TOML that is made to keep a reader busy: each file is refused with its place and reason, wherever TOML is read."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rds.bus.medium.fault_file import read_faults
from rds.core.errors import InputError
from rds.core.limits import LIFT
from rds.core.toml_file import LARGEST, parse_toml, read_toml
from rds.core.toml_table import TomlTable
from rds.grading.assignment.assignment import read_assignment
from rds.identification.logs.map import LogMap
from rds.machines import load_machine
from rds.results.reports.reading import read_toml as read_report

BOMBS = {
    "dotted": ("x = 1\na" + ".a" * 200_000 + " = 1\n", r"line 2: a key has 17 parts between dots or more"),
    "header": ("x = 1\n['a'" + ' . "a"' * 100_000 + "]\n", r"line 2: a key has 17 parts between dots or more"),
    "inline": ("x = {a" + ".a" * 100_000 + " = 1}\n", r"line 1: a key has 17 parts"),
    "nested": ("x = " + "[" * 200_000 + "]" * 200_000, "brackets within brackets hundreds deep; write it flatter"),
    "deep": ("x = " + "[" * 100 + "]" * 100, "x holds brackets or tables 65 deep or more; the limit is 64"),
    "digits": ("\nx = " + "1" * 400_000, r"line 2: has a number or date that cannot be read \(Exceeds"),
    "hexadecimal": ("\nx = 0x" + "f" * 400_000, r"line 2: x = 0xffff.* is a whole number of more than 64 bits"),
    "whole": ("[a]\nb = [1, 99999999999999999999]", r"line 2: a\.b = 99999.* more than 64 bits"),
    "key": ("\n" + "k" * 400_000 + " = 1", r"line 2: the key 'kkk.*has 400000 characters; the limit is 200"),
    "size": ("#" * (LARGEST + 1), "it has 1048577 bytes, too many for a TOML file; the limit is 1048576"),
    "open": ('x = """' + '\\"""' * 100_000, "is not valid TOML: Unterminated string"),
}


@pytest.mark.parametrize("name", BOMBS)
def test_it_is_refused_with_place_and_reason(name: str, tmp_path: Path) -> None:
    text, said = BOMBS[name]
    path = tmp_path / "bomb.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"bomb\.toml.*" + said) as refused:
        read_toml(path)
    assert len(str(refused.value)) < 500 + len(str(path))


DOORS: dict[str, Callable[[Path], object]] = {
    "experiment or model": lambda path: TomlTable.open(path),
    "machine": lambda path: load_machine(str(path)),
    "faults": read_faults,
    "map": lambda path: LogMap.read(path),
    "assignment": lambda path: read_assignment(path.parent),
    "report": read_report,
}


@pytest.mark.parametrize("door", DOORS)
def test_every_door_to_toml_has_these_limits(door: str, tmp_path: Path) -> None:
    path = tmp_path / "assignment.toml"
    path.write_text(BOMBS["dotted"][0])
    with pytest.raises(InputError, match=r"assignment\.toml, line 2: a key has 17 parts"):
        DOORS[door](path)


def test_nothing_else_in_the_package_parses_toml() -> None:
    import rds

    found = [
        path for path in Path(rds.__file__).parent.rglob("*.py") if "import tomllib" in path.read_text(encoding="utf-8")
    ]
    assert [path.name for path in found] == ["toml_file.py"]


def test_dots_in_texts_comments_and_numbers_count_for_nothing() -> None:
    dots = "a" + ".a" * 50
    text = f"x = '{dots}' # {dots}\ny = [1.0, 2.5e-3]\nz = \"\"\"\n{dots}\\\"\"\"\"\nu = '''{dots}''{dots}'''\n"
    assert parse_toml(text, "f")["x"] == dots


def test_many_tables_do_not_multiply_the_text(tmp_path: Path) -> None:
    path = tmp_path / "many.toml"
    path.write_text("\n" * 1000 + "[[case]]\nname = 1\n" * 1000)
    tables = TomlTable.open(path).tables("case")
    assert sum(len(table.source) for table in tables) <= path.stat().st_size
    assert tables[500].place("name") == f"{path}, line 2002"


def test_the_limits_are_lifted_by_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "long.toml"
    path.write_text("a" + ".a" * 19 + " = 1\n")
    with pytest.raises(
        InputError, match=r"the limit is 16: write fewer, or set RDS_FILE_LIMITS=2 if you trust the file"
    ):
        read_toml(path)
    monkeypatch.setenv(LIFT, "2")
    assert "a" in read_toml(path)[0]
    for wrong in ("much", "0.5", "nan", "inf"):
        monkeypatch.setenv(LIFT, wrong)
        with pytest.raises(InputError, match=f"RDS_FILE_LIMITS='{wrong}' must be a number from 1 to 1e\\+06"):
            read_toml(path)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it is a folder; name the TOML file"):
        read_toml(tmp_path)


def test_a_device_without_an_end_is_no_file() -> None:
    with pytest.raises(InputError, match="too many for a TOML file"):
        read_toml("/dev/zero")
