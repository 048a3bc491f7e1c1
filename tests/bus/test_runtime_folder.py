"""The folder of sockets: nobody else's, and one for all processes of a user, whatever others do to its name."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from rds.bus.hub.address import Address
from rds.bus.hub.runtime_folder import runtime_directory
from rds.core.errors import Notice
from rds.machines import load_machine

pytestmark = pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners and modes of files")

ASK = "from rds.bus.hub.runtime_folder import runtime_directory; print(runtime_directory())"
OTHER = 0x6F00ABCD  # a user that has no name


@pytest.fixture
def usual(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The usual folder, not made yet, in a temporary folder that all may write to, and a home beside that."""
    tmp_path_factory.getbasetemp()  # which pytest makes in the temporary folder of when it is first asked for
    with tempfile.TemporaryDirectory(prefix="rds", dir="/tmp") as base:
        monkeypatch.delenv("XDG_RUNTIME_DIR")
        monkeypatch.delenv("XDG_STATE_HOME", raising=False)
        for name, variable, mode in (("t", "TMPDIR", 0o1777), ("h", "HOME", 0o755)):
            place = Path(base, name)
            place.mkdir()
            place.chmod(mode)
            monkeypatch.setenv(variable, str(place))
        monkeypatch.setattr(tempfile, "tempdir", None)
        yield Path(base, "t", f"rds-{os.getuid()}")


def by_another_user(usual: Path) -> None:
    if os.getuid() != 0:
        pytest.skip("only root can make what belongs to another user")
    usual.mkdir(0o700)
    os.chown(usual, OTHER, OTHER)


def open_to_all(usual: Path) -> None:
    """In a temporary folder without the sticky bit, others can rename it and put their own in its place."""
    usual.mkdir(0o700)
    usual.parent.chmod(0o777)


TAKEN = {
    "a folder of another user": (by_another_user, "belongs to another user"),
    "a link to a folder of the user's": (lambda usual: usual.symlink_to(os.environ["HOME"]), "is no folder"),
    "a link to nothing": (lambda usual: usual.symlink_to("nothing"), "is no folder"),
    "a file": (Path.touch, "is no folder"),
    "a folder that others can replace": (open_to_all, "can be replaced by others"),
}


def asked_in_another_process() -> Path:
    done = subprocess.run([sys.executable, "-c", ASK], capture_output=True, text=True, check=True)
    assert not done.stderr, "only who moves it says so"
    return Path(done.stdout.strip())


def test_usually_it_is_in_the_temporary_folder(usual: Path) -> None:
    assert runtime_directory() == usual == asked_in_another_process()
    assert usual.stat().st_mode & 0o777 == 0o700
    assert not list(Path(os.environ["HOME"]).rglob("run-*/"))


@pytest.mark.parametrize("name", TAKEN)
def test_where_its_name_is_taken_it_is_in_the_home_and_stays_there(usual: Path, name: str) -> None:
    take, why = TAKEN[name]
    take(usual)
    with pytest.warns(Notice, match=f"{why}.*from now on") as said:
        moved = runtime_directory()
    assert str(usual) in str(said[0].message) and str(moved) in str(said[0].message)
    assert moved.is_relative_to(os.environ["HOME"]) and moved.stat().st_mode & 0o777 == 0o700
    assert asked_in_another_process() == moved
    usual.rmdir() if usual.is_dir() and not usual.is_symlink() else usual.unlink()
    usual.parent.chmod(0o1777)
    assert runtime_directory() == asked_in_another_process() == moved, "a name that becomes free parts no processes"
    assert not usual.exists()


def test_processes_that_begin_at_the_same_time_meet(usual: Path) -> None:
    """While the name is taken and given back again and again."""
    begun = [
        subprocess.Popen([sys.executable, "-W", "ignore", "-c", ASK], stdout=subprocess.PIPE, text=True)
        for _ in range(6)
    ]
    while any(process.poll() is None for process in begun):
        try:
            usual.symlink_to("nothing")
            usual.unlink()
        except FileExistsError:
            break  # one of them has it, and it is theirs: nobody else can take it away any more
    assert len({process.communicate()[0] for process in begun}) == 1
    assert all(process.returncode == 0 for process in begun)


def test_where_the_home_cannot_be_had_either_it_says_what_to_do(usual: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usual.touch()
    monkeypatch.setenv("HOME", str(usual))  # a file
    with pytest.raises(PermissionError, match=r"is no folder.*cannot be had instead.*set XDG_RUNTIME_DIR"):
        runtime_directory()


def test_a_runtime_directory_that_others_can_write_to_is_not_used(
    usual: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    tmp_path.chmod(0o777)
    assert runtime_directory() == usual


def test_the_command_line_says_a_notice_as_a_note(usual: Path) -> None:
    usual.touch()
    words = [sys.executable, "-m", "rds", "bus", "nodes", "--channel", "nobody"]
    said = subprocess.run(words, capture_output=True, text=True).stderr
    assert f"rds: note: {usual} is no folder" in said and "Notice" not in said


@pytest.mark.parametrize("name", ["Große Fräse", "a" * 33, "../x", "_", "ä", "mini cnc"])
def test_a_machine_of_any_name_has_a_channel_of_its_own(name: str) -> None:
    named = replace(load_machine("mini-cnc"), name=name)
    assert Address(named.channel).channel == named.channel != replace(named, name=f"{name}2").channel
    assert load_machine("mini-cnc").channel == "mini-cnc"
