"""The process that draws: pictures come from it, and without it from here."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import NoReturn

import pytest

from rds.core import drawing
from rds.core.errors import RdsError
from rds.modes.experiment import Experiment
from rds.modes.process import host

ASKS = """
import os, sys, time
from rds.core import drawing
{first}
drawing.begin("json")
{then}
print(*(drawing.asked("os", "getpid")() == os.getpid() for _ in range(2)))
print(drawing.asked("json", "dumps", [1.5])(), drawing.asked("operator", "call", {function})())
try:
    drawing.asked("json", "loads", "{{")()
except ValueError as error:
    print(error)
"""


@pytest.mark.parametrize(
    ("first", "then", "function", "here"),
    [
        ("", "", "dict", False),
        ("", "drawing.ready()", "dict", False),
        ("", "os.kill(drawing._process.number, 9)", "dict", True),
        ("", "drawing._process.asked.close()", "dict", True),
        ("", "os.closerange(3, 64)", "dict", True),
        ("", "", "lambda: {}", False),  # which cannot be sent
        ("del os.fork", "", "dict", True),
    ],
    ids=["asked at once", "ready", "killed", "file closed", "descriptors closed", "function", "no fork"],
)
def test_what_is_drawn_does_not_hang_on_the_process(first: str, then: str, function: str, here: bool) -> None:
    code = ASKS.format(first=first, then=then, function=function)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    where, drawn, fault = done.stdout.splitlines()
    assert where == f"{here} {here}"
    assert drawn == "[1.5] {}"
    assert fault.startswith("Expecting property name")


def test_while_it_draws_others_are_drawn_here() -> None:
    code = """
import os
from rds.core import drawing
drawing.begin("json")
first, second = (drawing.asked("os", "getpid") for _ in range(2))
print(second() == os.getpid(), first() == os.getpid(), drawing.asked("os", "getpid")() == os.getpid())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "True False False\n", done.stderr


def test_a_run_against_the_clock_begins_when_it_has_imported_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = []
    monkeypatch.setattr(drawing, "ready", lambda: order.append("ready"))

    def _recorded(*_: object) -> NoReturn:
        order.append("run")
        raise RdsError

    monkeypatch.setattr(host, "_recorded", _recorded)
    experiment = Experiment.from_toml(_experiment(tmp_path))
    experiment.run()
    assert order == []
    with pytest.raises(RdsError):
        experiment.run("emulation", out=tmp_path / "out")
    assert order == ["ready", "run"]


def _experiment(folder: Path) -> Path:
    (folder / "law.py").write_text("def control(t, r, y, state, params):\n    return 30.0 * (r.position - y), state\n")
    (folder / "first.toml").write_text(
        'axes = ["X", "Y"]\nduration = 1.0\n'
        'reference = {kind = "sinusoid", amplitude = 5.0, frequency = 2.0}\ncontroller = {file = "law.py"}\n'
    )
    return folder / "first.toml"


def test_the_run_itself_imports_no_matplotlib(tmp_path: Path) -> None:
    code = """
import sys
from pathlib import Path
from rds.core import drawing
drawing.begin("rds.results.pictures")
from rds.modes.experiment.report import run_and_save
run_and_save(Path("first.toml"), None, Path("out"), None)
print("matplotlib" in sys.modules)
"""
    _experiment(tmp_path)
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.stdout == "False\n", done.stderr


def test_a_run_leaves_the_same_pictures_with_it_and_without(tmp_path: Path) -> None:
    _experiment(tmp_path)
    without = "import os; del os.fork; from rds.__main__ import main; main()"
    for folder, how in (("with", ["-m", "rds"]), ("without", ["-c", without])):
        command = [sys.executable, *how, "run", "first.toml", "--out", folder]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
    for name in ("X.png", "Y.png"):
        assert (tmp_path / "with" / name).read_bytes() == (tmp_path / "without" / name).read_bytes()
