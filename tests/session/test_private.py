"""Nobody else on the computer reads a run while it goes on or afterwards, its page's folder, or a log of its bus."""

from __future__ import annotations

import contextlib
import json
import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest
from lost_machines import unless_lost
from other_user import SIGN, hall, open_by_mode, seen_by_another
from typer.main import get_command
from typer.testing import CliRunner

import rds
from rds.bus.tools.logs import ENDINGS, LogWriter
from rds.cli.main import app
from rds.core.private_files import SHARED
from rds.panels.session.claim import Claim
from rds.panels.session.fields import Flag
from rds.panels.session.formula import formula_file
from rds.panels.session.saving import saving
from rds.panels.session.session import Session

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs modes of files")
needs_root = pytest.mark.skipif(os.name != "posix" or os.getuid() != 0, reason="only root can become another user")

TOML = """
axis = "X"
duration = 0.05
[reference]
kind = "sinusoid"
amplitude = 1.0
frequency = 5.0
[controller]
name = "p"
"""


@pytest.fixture
def open_hall(alone: Path) -> Iterator[Path]:
    with hall() as place:
        yield place


def shared_memory(folder: Path) -> list[Path]:
    """What the processes of the run in `folder` share, as its record says; other runs of this computer are not ours."""
    with contextlib.suppress(OSError, ValueError):
        live_values = Path(json.loads((folder / "processes.json").read_text())["live_values"])
        return [path for path in (live_values, live_values.with_suffix(".ring")) if path.exists()]
    return []


@pytest.mark.realtime
@pytest.mark.parametrize("mode", ["emulation", "implementation"])
def test_a_run_and_its_machine(open_hall: Path, mode: str) -> None:
    """While it goes on, under a umask that keeps nothing from others: its record, its memory, its bus, its results."""
    runtime = Path(os.environ["XDG_RUNTIME_DIR"])
    runtime.chmod(0o711)  # the folder in it has to keep others out by itself
    found: list[str] = []
    looked = set()

    def look(done: int, of: int) -> None:
        places = [*open_hall.glob("runs/*"), *shared_memory(open_hall / "runs" / "one"), *runtime.iterdir()]
        looked.update(path.suffix or path.name for path in places)
        found.extend(open_by_mode(places))
        if os.getuid() == 0:
            found.extend(seen_by_another([*places, runtime / "rds"]))

    experiment = rds.Experiment(duration=0.3, reference=rds.sinusoid(2.0, 1.0), controller={"name": "p"})
    unless_lost(lambda: experiment.run(mode, out=open_hall / "runs" / "one", progress=look))
    look(0, 0)
    assert {".ring", ".live", "one", "rds"} <= looked
    # the socket has the modes of its umask; its folder keeps others out
    assert [line for line in found if not line.partition(" ")[2].startswith("s")] == []
    assert (open_hall / "runs" / "one" / "record.rds").is_file()


@needs_root
def test_another_user_is_not_blind(open_hall: Path) -> None:
    assert seen_by_another([open_hall]) == [str(open_hall), str(open_hall / SIGN)]


def test_a_pages_folder(open_hall: Path) -> None:
    folder = open_hall / "page"
    folder.mkdir(0o755)
    session = Session(folder)
    session.choices("p", [Flag("f", "F", "", False)]).set("f", True)  # which is kept
    formula_file(folder, "sin(t)", 0.1, 0.01)
    with Claim(folder, "a test"), saving(folder / "runs" / "one"):
        assert {".machine.lock", "signals"} <= {path.name for path in folder.iterdir()}
        assert open_by_mode(folder.iterdir()) == []


@pytest.mark.parametrize("again", [False, True], ids=["new", "overwritten"])
@pytest.mark.parametrize("ending", [*ENDINGS, ".log.gz"])
def test_a_log_of_the_bus(open_hall: Path, ending: str, again: bool) -> None:
    if ending == ".mf4":
        pytest.importorskip("asammdf")
    path = open_hall / f"log{ending}"
    if again:
        path.touch()
        path.chmod(0o666)
    writer = LogWriter(path, force=again)
    writer.write(can.Message(arbitration_id=1, data=b"12", timestamp=1.0, is_extended_id=False))
    writer.flush()
    assert open_by_mode([path]) == []
    writer.close()
    assert path.stat().st_size and open_by_mode(path for path in open_hall.iterdir() if path.name != SIGN) == []


@pytest.mark.parametrize("umask", [0o000, 0o077], ids=["permissive", "strict"])
@pytest.mark.parametrize("how", ["private", "option", "environment"])
def test_the_command_line(alone: Path, how: str, umask: int) -> None:
    with hall(umask) as place:
        (place / "experiment.toml").write_text(TOML)
        (place / "experiment.toml").chmod(0o644)
        words = ["run", str(place / "experiment.toml"), "--out", str(place / "new" / "run")]
        words += ["--shared"] if how == "option" else []
        done = CliRunner().invoke(app, words, env={SHARED: "1" if how == "environment" else ""})
        assert done.exit_code == 0, done.stderr
        made = [place / "new", *(place / "new").rglob("*")]
        modes = {(path.is_dir(), stat.S_IMODE(path.stat().st_mode)) for path in made}
        assert modes == ({(True, 0o700), (False, 0o600)} if how == "private" else {(True, 0o750), (False, 0o640)})
        assert {"result.csv", "report.html", "X.png"} <= {path.name for path in made}
        if os.getuid() == 0:
            assert seen_by_another([place / "new"]) == []
            seen = seen_by_another([place / "new"], group=os.getgid())
            assert sorted(seen) == ([] if how == "private" else sorted(str(path) for path in made))


def test_a_setting_that_is_not_understood_is_refused(alone: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rds", "machine", "list"],
        capture_output=True,
        text=True,
        env=os.environ | {SHARED: "all"},
    )
    assert done.returncode == 2 and "RDS_SHARED = 'all'" in done.stderr and "Traceback" not in done.stderr


def leaves(command: Any, name: str = "rds") -> Iterator[tuple[str, set[str]]]:
    """All commands, with their options."""
    if hasattr(command, "commands"):
        for word, below in command.commands.items():
            yield from leaves(below, f"{name} {word}")
    else:
        yield name, {option for parameter in command.params for option in parameter.opts}


def test_each_command_that_writes_can_share() -> None:
    commands = dict(leaves(get_command(app)))
    writing = {name for name, options in commands.items() if options & {"--out", "--plot", "--report", "--force"}}
    assert {name for name in writing if "--shared" not in commands[name]} == set()
    assert {"rds run", "rds nc run", "rds grade run", "rds bus record", "rds app"} <= {
        name for name, options in commands.items() if "--shared" in options
    }
