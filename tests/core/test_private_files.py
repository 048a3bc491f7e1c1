"""What rds makes is its user's alone under any umask, until he shares it; and there is one place that makes it so."""

from __future__ import annotations

import ast
import errno
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from rds.core.atomic import write_whole
from rds.core.errors import InputError
from rds.core.private_files import (
    SHARED,
    keep_process_private,
    make_folder,
    open_descriptor,
    open_private,
    umask,
    write_private,
)

pytestmark = pytest.mark.skipif(os.name != "posix", reason="needs modes of files")

SOURCE = Path(__file__).parents[2] / "rds"
UMASKS = (0o000, 0o022, 0o077, 0o277)


@pytest.fixture(params=UMASKS, ids=oct)
def any_umask(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.delenv(SHARED, raising=False)
    before = os.umask(request.param)
    yield
    os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def written(folder: Path) -> list[Path]:
    """A file by each way to write one."""
    paths = [folder / name for name in ("opened", "descriptor", "small", "whole", "appended")]
    with open_private(paths[0], "w", encoding="utf-8") as file:
        file.write("é")
    os.close(open_descriptor(paths[1], os.O_RDWR | os.O_CREAT))
    write_private(paths[2], b"1")
    write_whole(paths[3], b"1")
    with open_private(paths[4], "ab") as file:
        file.write(b"1")
    return paths


@pytest.mark.parametrize(("shared", "file", "folder"), [("", 0o600, 0o700), ("0", 0o600, 0o700), ("1", 0o640, 0o750)])
def test_modes_are_the_same_under_any_umask(
    any_umask: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shared: str, file: int, folder: int
) -> None:
    monkeypatch.setenv(SHARED, shared)
    make_folder(tmp_path / "a" / "b")
    assert [mode(tmp_path / name) for name in ("a", "a/b")] == [folder, folder]
    assert {mode(path) for path in written(tmp_path / "a" / "b")} == {file}
    write_private(tmp_path / "own", b"", is_own=True)
    assert mode(tmp_path / "own") == 0o600, "never the group's"


def test_a_folder_that_is_there_keeps_its_mode_and_files_in_it_are_private(any_umask: None, tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    make_folder(tmp_path)
    assert mode(tmp_path) == 0o755
    assert {mode(path) for path in written(tmp_path)} == {0o600}


def test_a_file_that_was_open_to_all_is_closed_to_them_before_it_is_written(any_umask: None, tmp_path: Path) -> None:
    for path in written(tmp_path):
        path.chmod(0o666)
    assert {mode(path) for path in written(tmp_path)} == {0o600}


def test_a_new_folder_keeps_the_group_that_the_one_above_hands_down(
    any_umask: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SHARED, "1")
    tmp_path.chmod(0o2770)
    make_folder(tmp_path / "a" / "b")
    write_whole(tmp_path / "a" / "b" / "file", b"")
    assert [mode(tmp_path / name) for name in ("a", "a/b", "a/b/file")] == [0o2750, 0o2750, 0o640]


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for name in ("file", "file/below"):
        with pytest.raises(OSError):
            make_folder(tmp_path / name)


def test_a_device_keeps_its_mode() -> None:
    before = mode(Path("/dev/null"))
    open_private("/dev/null", "wb").close()
    assert mode(Path("/dev/null")) == before


def test_another_word_for_sharing_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SHARED, "yes")
    with pytest.raises(InputError, match=r"RDS_SHARED = 'yes' in the environment must be 1 .* or 0"):
        make_folder(tmp_path / "a")


def test_the_umask_of_a_process_of_rds(monkeypatch: pytest.MonkeyPatch) -> None:
    before = os.umask(0)
    try:
        for shared, wanted in (("0", 0o077), ("1", 0o027)):
            monkeypatch.setenv(SHARED, shared)
            keep_process_private()
            assert os.umask(0) == umask() == wanted
    finally:
        os.umask(before)


# Files that are made elsewhere, each with the reason why it may be.
ELSEWHERE = {
    "core/private_files.py": "the one place",
    "bus/hub/runtime_folder.py": "its own modes, checked",
    "bus/hub/error_states.py": "0600, in the runtime folder",
    "bus/hub/command.py": "0600, in the runtime folder",
    "bus/hub/address.py": "0600, in the runtime folder",
    "bus/hub/hub.py": "0600, in the runtime folder",
    "bus/modules/dcs/port.py": "0600, in the runtime folder",
    "bus/modules/dcs/server.py": "0600, in the runtime folder",
    "panels/app/kernel_stack.py": "0600, in a folder of mkdtemp",
    "grading/exports/one_submission.py": "in a folder of mkdtemp",
    "grading/container/container.py": "what an image is made from, in a folder of mkdtemp",
    "grading/sandbox/user.py": "in a mount namespace of its own",
    "grading/sandbox/inside/worker.py": "inside the sandbox",
    "grading/sandbox/inside/walls.py": "inside the sandbox",
    "grading/sandbox/inside/probe.py": "inside the sandbox",
    "identification/logs/csv_table.py": "in a folder of mkdtemp",
}
METHODS = ("write_text", "write_bytes", "mkdir", "makedirs", "touch", "copytree", "copyfile", "copy2", "mknod")
CALLS = re.compile(rf"\b({'|'.join((*METHODS, 'open', 'savefig'))})\s*\(")


def makes_files(text: str) -> Iterator[tuple[int, str]]:
    """Calls that make a file or folder of the system's own mode: their lines and names."""
    if not CALLS.search(text):
        return  # most files: they need not be parsed
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        given = [*node.args, *(each.value for each in node.keywords)]
        texts = [each.value for each in given if isinstance(each, ast.Constant) and isinstance(each.value, str)]
        writes = any(set(text) <= set("wxabt+") and set(text) & set("wxa") for text in texts)
        creates = name == "open" and (writes or "O_CREAT" in ast.dump(node))
        names_file = name == "savefig" and not any(each.arg == "format" for each in node.keywords)
        if name in METHODS or creates or names_file:
            yield node.lineno, name


@pytest.mark.parametrize(
    "text", ["open(p, 'w')", "p.open('ab')", "p.mkdir()", "os.open(p, os.O_RDWR | os.O_CREAT, 0o600)", "f.savefig(p)"]
)
def test_the_search_finds_what_makes_a_file(text: str) -> None:
    assert list(makes_files(text))


def test_files_are_made_in_one_place() -> None:
    """And so are private: use rds.core.private_files, or give the reason here."""
    found = {}
    for path in sorted(SOURCE.rglob("*.py")):
        if calls := list(makes_files(path.read_text(encoding="utf-8"))):
            found[path.relative_to(SOURCE).as_posix()] = calls
    assert {name: calls for name, calls in found.items() if name not in ELSEWHERE} == {}
    assert set(ELSEWHERE) <= set(found), "a reason that is not needed any more"


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="this system has no /proc")
def test_a_disk_that_cannot_sync_folders_keeps_files_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sync = os.fsync

    def of_files(descriptor: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "Invalid argument")
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", of_files)
    assert write_whole(tmp_path / "result.csv", b"1").read_bytes() == b"1"


def test_a_folder_where_nothing_can_be_made_is_an_error_of_the_system() -> None:
    """There the kernel says that it does not exist, and not that it may not be."""
    with pytest.raises(OSError):
        make_folder("/proc/nothing/here")
