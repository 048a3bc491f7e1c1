"""`rds nc run` and its document: the commands shown work, every key is named, keys of a terminal do what is said."""

from __future__ import annotations

import json
import os
import pty
import re
import select
import shlex
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from documents import blocks
from typer.testing import CliRunner

import rds
from rds.cli.keys import Keys
from rds.cli.main import app
from rds.cli.nc_operate import press
from rds.modes.loop.execution import State
from rds.modes.loop.program import COLUMNS, program_channels
from rds.nc.run.judge import WAITS

DOCUMENT = "docs/part-programs.md"
TEXT = (Path(__file__).parents[2] / DOCUMENT).read_text(encoding="utf-8").partition("## Running")[2]
COMMANDS = [
    shlex.split(line)[1:]
    for block in blocks(DOCUMENT)
    if block.language == "sh" and "circular" not in block.text  # which draws a picture of the document (pictures.py)
    for line in block.text.splitlines()
]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_the_commands_of_the_document_work(command: list[str], part: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(part.parent)
    (part.parent / "tools.tbl").write_text("T1 P1 Z12.0 D3.0\n")
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    folder = Path("fast") if "--out" in command else next(Path("runs").iterdir())
    assert {"program.html", "report.html", "result.csv", "program-path.png"} <= {path.name for path in folder.iterdir()}
    page, about = (folder / "program.html").read_text(), rds.open_result(folder).meta["program"]
    worst = about["contour_error"]
    assert f"{worst['max']:.4f} mm off the programmed path, in line {worst['line']}" in page
    assert part.read_text().splitlines()[worst["line"] - 1] in page
    assert "data:image/png;base64" in page and 'href="./report.html"' in page
    assert 'href="./program.html"' in (folder / "report.html").read_text()
    if "--json" not in command:
        assert "off the programmed path, in line" in done.stdout
        return
    found = json.loads(done.stdout)
    assert found["program"]["completed"]
    assert set(found["program"]) - {"file"} <= set(re.findall(r"`(\w+)`", TEXT))
    assert found["files"]["program"] == str(folder / "program.html")


def test_every_column_state_and_live_value_is_named() -> None:
    named = set(re.findall(r"`(\w+)`", TEXT))
    assert {*COLUMNS, "contour_error", *WAITS.values()} <= named
    assert {channel.name for channel in program_channels()} | {"stop"} <= named
    numbers = re.search(r"`program_state` \| (.*) \|", TEXT)
    assert numbers
    assert [int(n) for n in re.findall(r"(?:^|, )(\d)", numbers[1])] == [
        state for state in State if state != State.OVER
    ]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--mode", "system-test"], "mode system-test has no controllers"),
        (["--override", "250"], r"not in the range 0\.0<=x<=200\.0|less than or equal to 200"),  # by typer's version
        (["--override", "1.5", "--mode", "system-test"], "is in per cent; for 1.5 times the feed give 150"),
        (["--override", "0"], "--override 0 never moves, or as good as never; begin with 0.1 or more, and hold"),
        (["--override", "1e-300"], "--override 1e-300 never moves, or as good as never"),
        (["--controller", "nonsense"], "nonsense"),
        (["--controller", "nothing.toml"], "cannot be read"),
        (["--machine", "nowhere"], "there is no machine 'nowhere'"),
        (["--tools", "nothing.tbl"], "nothing.tbl"),
    ],
)
def test_refusals(options: list[str], said: str, part: Path) -> None:
    done = CliRunner().invoke(app, ["nc", "run", str(part), "--out", str(part.parent / "out"), *options])
    assert done.exit_code == 2
    assert re.search(said, done.output)
    assert not (part.parent / "out").exists()


@pytest.mark.parametrize("out", ["part.ngc", "part.ngc/inside", "/proc/nope"])
@pytest.mark.parametrize("command", [["nc", "run", "part.ngc"], ["run", "experiment.toml"]], ids=["nc run", "run"])
def test_a_folder_that_cannot_be_is_told_before_anything_runs(
    out: str, command: list[str], part: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(part.parent)
    words = 'axis = "X"\nduration = 1.0\n[reference]\nkind = "constant"\nvalue = 1.0\n[controller]\nname = "p"\n'
    Path("experiment.toml").write_text(words)
    started: list[object] = []
    monkeypatch.setattr("rds.modes.experiment.experiment.run_plan", lambda *arguments: started.append(arguments))
    done = CliRunner().invoke(app, [*command, "--out", out])
    assert done.exit_code == 2
    assert "name another folder" in done.stderr
    assert not started


def test_what_is_replaced_is_told(one_axis: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(one_axis[0]).parent)
    earlier = [Path("out") / name for name in ("changes.csv", "program-changed-while-it-ran.csv")]
    Path("out").mkdir()
    for file in (*earlier, Path("out/result.csv"), Path("out/program.txt")):
        file.write_text("time [s],X_measured [mm]\n")
    done = CliRunner().invoke(app, ["nc", "run", *one_axis, "--out", "out"])
    assert done.exit_code == 0, done.output
    assert "out: replaces the results of an earlier run there" in done.stderr
    assert not any(file.exists() for file in earlier)
    assert Path("out/program.txt").exists()  # none of ours
    assert Path("out/program-path.png").stat().st_size > 5000  # of one axis, too


class Running:
    """A run as the keys see it."""

    def __init__(self, state: State):
        self.live_values = {"hold": 0.0, "override": 1.95}
        self.did: list[str] = []
        self.state = state

    def status(self) -> Any:
        return SimpleNamespace(state=self.state)

    def override(self, share: float) -> None:
        self.did.append(f"override {share:g}")

    def __getattr__(self, verb: str) -> Any:
        return lambda: self.did.append(verb)


@pytest.mark.parametrize(
    ("key", "state", "does"),
    [
        (" ", State.RUNS, ["hold"]),
        (" ", State.HELD, ["resume"]),
        (" ", State.STOP, ["resume"]),
        (" ", State.TOOL, ["resume"]),
        ("+", State.RUNS, ["override 2"]),
        ("-", State.RUNS, ["override 1.85"]),
        ("h", State.HELD, ["home"]),
        ("q", State.RUNS, ["stop"]),
        ("x", State.RUNS, []),
    ],
)
def test_what_a_key_does(key: str, state: State, does: list[str]) -> None:
    running: Any = Running(state)
    press(key, running)
    assert running.did == does


def test_keys_come_one_by_one() -> None:
    ours, theirs = os.openpty()
    try:
        keys = Keys(theirs)
        assert keys.pressed(0.0) == ""
        os.write(ours, b" +\n")
        assert keys.pressed(5.0) == " +\n"
    finally:
        os.close(ours)
        os.close(theirs)


@pytest.mark.realtime
def test_a_terminal_operates_the_run(one_axis: list[str], alone: Path) -> None:
    """In a real terminal: faster, hold, on, and home from the stop."""
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "rds.cli.main", "nc", "run", *one_axis, "--mode", "emulation", "--out", "run"]
    host = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True)
    os.close(theirs)
    screen = b""

    def shows(word: str) -> None:
        nonlocal screen
        deadline = time.monotonic() + 90.0
        while word.encode() not in screen:
            assert time.monotonic() < deadline, screen[-2000:]
            if select.select([ours], [], [], 0.1)[0]:
                screen += os.read(ours, 65536)
        screen = b""

    try:
        shows(" runs")
        os.write(ours, b"+ ")
        shows(" held")
        os.write(ours, b" ")
        shows(" stops")
        os.write(ours, b"h")
        shows("went home from line 7")
    finally:
        host.kill()
        host.wait()
        os.close(ours)
    changes = [line.split(",")[1:] for line in (alone / "run" / "changes.csv").read_text().splitlines()[1:]]
    assert changes[:2] == [["override", "1.0", "1.1"], ["hold", "0.0", "1.0"]]
    assert changes[-1] == ["home", "0.0", "1.0"]
