"""Grading in a container, and the self-check on systems without the sandbox. The container's program is asked, not "
"run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rds.cli.main import app
from rds.core.errors import InputError
from rds.grading.assignment.assignment import read_assignment
from rds.grading.batch.finished import read_finished
from rds.grading.container import container
from rds.grading.review.publish import assignment_of
from rds.grading.sandbox.requirements import _remedy
from tests.grading.grades import batch_in, grade
from tests.grading.made import HEAD, RMS, SINE, assignment_in

WITHOUT_UNIX = """
import os, sys
import rds.__main__
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
for name in ("O_NOFOLLOW", "O_DIRECTORY", "O_NONBLOCK", "geteuid", "getuid", "pidfd_open", "fchmod"):
    delattr(os, name)
if sys.argv[1] == "platform":
    import types
    import rds.grading.sandbox.requirements
    rds.grading.sandbox.requirements.sys = types.SimpleNamespace(platform="win32")
sys.argv = ["rds", "grade", *sys.argv[2:]]
rds.__main__.main()
"""


def without_unix(*words: str) -> subprocess.CompletedProcess[str]:
    """`rds grade` in a Python that has nothing of Unix which Windows lacks."""
    return subprocess.run([sys.executable, "-c", WITHOUT_UNIX, *words], capture_output=True, text=True, check=False)


def test_ones_own_file_is_tried_where_there_is_no_unix(tmp_path: Path) -> None:
    task = assignment_in(tmp_path / "task", HEAD + SINE + RMS)
    done = without_unix("", "self", str(task), str(task / "solution.py"), "--trust-my-file")
    assert done.returncode == 0 and "pass" in done.stdout, done.stderr
    done = without_unix("", "self", str(task), str(task / "solution.py"))
    assert done.returncode == 2 and "--trust-my-file" in done.stderr and "Traceback" not in done.stderr
    done = without_unix("platform", "run", str(task), str(task), "-o", str(tmp_path / "out"))
    assert done.returncode == 2 and "--container" in done.stderr and "Traceback" not in done.stderr


def test_what_a_container_has_graded_is_exported_where_there_is_no_unix(tmp_path: Path) -> None:
    out = batch_in(tmp_path / "out", [grade("ada")])
    done = without_unix("", "export", str(out), "--to", "moodle")
    assert done.returncode == 0 and "1 students" in done.stdout, done.stderr


def test_the_container_reads_what_it_grades_and_writes_one_folder(tmp_path: Path) -> None:
    places = (tmp_path / "ps1", tmp_path / "submitted", tmp_path / "out")
    words = container.command("docker", "rds-grader:1", *places, ["--jobs", "2"], [("--class", tmp_path / "class.csv")])
    volumes = [word.partition("=")[2].rsplit(":", 2) for word in words if word.startswith("--volume=")]
    assert {(inside, mode) for _, inside, mode in volumes} == {
        ("/assignment/ps1", "ro"),
        ("/submissions/submitted", "ro"),
        ("/out", "rw"),
        ("/more/0/class.csv", "ro"),
    }
    behind = words[words.index("rds-grader:1") + 1 :]
    assert behind == [
        "/assignment/ps1",
        "/submissions/submitted",
        "-o",
        "/out",
        "--jobs",
        "2",
        "--class",
        "/more/0/class.csv",
    ]
    assert "--network=none" in words and "--privileged" not in words


@pytest.mark.parametrize(
    ("name", "user", "who"),
    [
        ("docker", 1000, ["--user=1000:100"]),
        ("docker", 0, ["--cap-add=SYS_ADMIN"]),
        ("docker", None, ["--cap-add=SYS_ADMIN"]),  # Windows
        ("podman", 1000, ["--userns=keep-id"]),
        ("podman", 0, ["--cap-add=SYS_ADMIN"]),
        ("podman", None, ["--userns=keep-id"]),
    ],
)
def test_the_caller_grades_and_the_sandbox_may_mount_its_own_proc(
    name: str, user: int | None, who: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if user is None:
        monkeypatch.delattr(container.os, "getuid")
    else:
        monkeypatch.setattr(container.os, "getuid", lambda: user)
        monkeypatch.setattr(container.os, "getgid", lambda: 100)
    words = container.command(name, "rds-grader:1", tmp_path, tmp_path, tmp_path / "out", [])
    assert [word for word in words if word.startswith(("--user", "--cap-add"))] == who
    assert {"docker": "systempaths=unconfined", "podman": "unmask=ALL"}[name] in words


def test_a_container_that_refuses_the_sandbox_is_told_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "unmask=ALL" in _remedy("bwrap: Can't mount proc on /newroot/proc: Operation not permitted")
    monkeypatch.setattr("os.geteuid", lambda: 0)
    assert "--cap-add=SYS_ADMIN" in _remedy("rds sandbox: [Errno 1] unshare: Operation not permitted")
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    assert "SYS_ADMIN" not in _remedy("bwrap: No permissions to create a new namespace")


def test_the_image_is_made_of_this_copy_and_what_grading_requires(tmp_path: Path) -> None:
    container.write_context(tmp_path)
    assert (tmp_path / "rds/grading/assignment/starters/model/assignment.toml").is_file()
    assert not list(tmp_path.rglob("__pycache__"))
    names = {line.partition(">")[0].partition("[")[0] for line in (tmp_path / "requirements.txt").read_text().split()}
    assert {"numpy", "scipy", "control", "pyarrow", "pyseccomp", "nbformat"} <= names
    assert not {"jupyterlab", "pytest", "mini-cnc-rds"} & names


def test_no_option_of_the_command_is_lost_on_the_way_into_the_container(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[str]] = []
    monkeypatch.setattr(container, "run_in_container", lambda a, s, out, options, mounted: asked.append(options) or 0)
    monkeypatch.setenv("RDS_SHARED", "")  # put back afterwards, as the umask is not
    monkeypatch.setattr("rds.cli.common.keep_process_private", lambda: None)
    words = ["grade", "run", str(tmp_path), str(tmp_path), "-o", str(tmp_path / "out"), "--container"]
    assert CliRunner().invoke(app, [*words, "--shared", "--jobs", "2", "--resume"]).exit_code == 0
    assert asked == [["--jobs", "2", "--resume", "--shared"]]
    done = CliRunner().invoke(app, [*words, "--tls-ca", "ca.pem"])
    assert done.exit_code == 2 and "leave out --tls-ca" in done.output


def test_the_record_has_the_assignment_s_place_and_not_the_container_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    task, out = assignment_in(tmp_path / "task", HEAD + SINE + RMS), tmp_path / "out"
    record = {"folder": "/assignment/task", "assignment": read_assignment(task).sha256}

    def grades(words: list[str]) -> subprocess.CompletedProcess[str]:
        batch_in(out, [grade("ada")], **record)
        return subprocess.CompletedProcess(words, 0)

    monkeypatch.setattr(container, "program", lambda: "docker")
    monkeypatch.setattr(container, "build", lambda name: "rds-grader:1")
    monkeypatch.setattr(container.subprocess, "run", grades)
    assert container.run_in_container(task, task, out, []) == 0
    assert assignment_of(read_finished(out)).folder == task


def test_without_a_program_for_containers_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(container.shutil, "which", lambda name: None)
    (tmp_path / "in").mkdir()
    with pytest.raises(InputError, match="neither docker nor podman"):
        container.run_in_container(tmp_path, tmp_path / "in", tmp_path / "out", [])
    with pytest.raises(InputError, match="no such file"):
        container.run_in_container(tmp_path / "nowhere", tmp_path / "in", tmp_path / "out", [])
    assert not (tmp_path / "out").exists()
