"""What a submission cannot reach. Each attack runs inside: it reports what it found as the value of a function."""

from __future__ import annotations

import os
import platform
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from waiting import wait_for

from rds.core.types import Reference
from rds.grading.grade import Status
from rds.grading.sandbox import Limits, Pool, SandboxError, SubmissionError

Written = Callable[..., Path]


def answer(pool: Pool, path: Path) -> Any:
    """What the function `attack` of the submission at `path` returns."""
    with pool.open(path, kind="functions") as subject:
        return subject.call("attack")


def test_it_is_nobody_with_nobody_beside_it(pool: Pool, written: Written) -> None:
    text = """
import os, resource
def attack():
    found = []
    for number in range(1, 32768):
        try:
            os.kill(number, 0)
            found.append(number)
        except PermissionError:
            found.append(-number)
        except ProcessLookupError:
            pass
    return [os.getuid(), os.geteuid(), os.getpid(), os.getppid(), found, resource.getrlimit(resource.RLIMIT_CORE)[1]]
"""
    assert answer(pool, written(text, "")) == [1000, 1000, 2, 1, [1, 2], 0]


def test_it_sees_its_own_file_and_a_system_to_read(pool: Pool, written: Written) -> None:
    text = """
import os
def attack():
    found = {}
    for folder in ("/tmp", "/proc", "/dev", "/etc", "/opt/rds/rds", "/opt/rds/rds/grading"):
        found[folder] = sorted(os.listdir(folder))
    written = []
    for root, folders, files in os.walk("/"):
        try:
            with open(os.path.join(root, "written"), "w"):
                written.append(root)
        except OSError:
            pass
        folders[:] = [name for name in folders if root.count("/") < 3]
    found["written"] = written
    secrets = ("/etc/passwd", "/etc/shadow", "/home", "/sys", "/var", "/run")
    found["there"] = [name for name in secrets if os.path.exists(name)]
    found["environment"] = sorted(os.environ)
    return found
"""
    found = answer(pool, written(text, ""))
    assert found["/tmp"] == ["submission.py"]
    assert found["/proc"] == []
    assert found["/dev"] == ["null", "random", "urandom"]
    assert found["/etc"] == ["ld.so.cache"]
    assert not {"controllers", "interpolators", "experiment", "identification"} & set(found["/opt/rds/rds"])
    assert set(found["/opt/rds/rds/grading"]) <= {"__init__.py", "grade.py", "sandbox"}
    assert found["written"] == ["/tmp"]
    assert found["there"] == []
    assert not set(found["environment"]) & set(os.environ) - {"HOME", "LANG", "PATH", "PWD", "TZ"} - _threads()


def _threads() -> set[str]:
    return {name for name in os.environ if name.endswith("_NUM_THREADS") or name.startswith(("MPL", "PYTHON"))}


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the numbers of system calls are those of x86-64")
def test_calls_that_lead_out_are_refused(pool: Pool, written: Written) -> None:
    text = """
import ctypes, errno, os, platform
def attack():
    libc = ctypes.CDLL(None, use_errno=True)
    def tried(call, *arguments):
        ctypes.set_errno(0)
        return [libc[call](*arguments), errno.errorcode.get(ctypes.get_errno())]
    own = b"/tmp"
    found = {
        "ptrace": tried("ptrace", 16, 1, 0, 0),
        "unshare": tried("unshare", 0x10000000),
        "setns": tried("setns", 1, 0),
        "mount": tried("mount", b"none", own, b"tmpfs", 0, 0),
        "umount": tried("umount2", own, 2),
        "chroot": tried("chroot", own),
        "pivot_root": tried("syscall", 155, own, own),
        "bpf": tried("syscall", 321, 0, 0, 0),
        "perf_event_open": tried("syscall", 298, 0, 0, 0, 0, 0),
        "userfaultfd": tried("syscall", 323, 0),
        "io_uring_setup": tried("syscall", 425, 1, 0),
        "keyctl": tried("syscall", 250, 0, 0, 0, 0, 0),
        "process_vm_readv": tried("process_vm_readv", 1, 0, 0, 0, 0, 0),
        "personality": tried("personality", 0x0040000),
        "socket": tried("socket", 1, 1, 0),
        "socketpair": tried("socketpair", 1, 1, 0, 0),
        "execve": tried("execve", b"/usr/lib", 0, 0),
        "memfd_create": tried("memfd_create", b"x", 0),
        "shmget": tried("shmget", 0, 4096, 0o1000),
        "symlink": tried("symlink", b"/", b"/tmp/root"),
        "mknod": tried("mknod", b"/tmp/fifo", 0o10600, 0),
        "setuid": tried("setuid", 0),
        "clone in a new namespace": tried("syscall", 56, 0x10000011, 0, 0, 0, 0),
    }
    return found
"""
    found = answer(pool, written(text, ""))
    assert len(found) == 23
    assert {name: result for name, result in found.items() if result != [-1, "EPERM"]} == {}


def test_it_has_its_own_descriptors_only(pool: Pool, written: Written) -> None:
    text = """
import os, stat
def attack():
    kinds = []
    for number in range(4096):
        try:
            mode = os.fstat(number).st_mode
        except OSError:
            continue
        kinds.append([number, "pipe" if stat.S_ISFIFO(mode) else "null" if stat.S_ISCHR(mode) else "other"])
    return kinds
"""
    found = answer(pool, written(text, ""))
    assert [kind for _, kind in found] == ["null", "pipe", "pipe", "pipe", "pipe", "other", "other", "other"]


def test_it_cannot_resize_the_memory_that_it_shares(pool: Pool, written: Written) -> None:
    text = """
import os
def attack():
    refused = 0
    for number in range(64):
        try:
            os.ftruncate(number, 0)
        except OSError:
            refused += 1
    return refused
"""
    assert answer(pool, written(text, "")) == 64


@pytest.mark.parametrize(
    ("attack", "status", "said"),
    [
        ("import os; os._exit(3)", Status.KILLED, "exit code 3"),
        ("import os; os.kill(os.getpid(), 9)", Status.KILLED, "SIGKILL"),
        ("import ctypes; ctypes.string_at(0)", Status.KILLED, "SIGSEGV"),
        ("import os, time; os.closerange(3, 64); time.sleep(60)", Status.BROKE_CONTRACT, "pipe"),
        (
            "import os\nfor n in range(3, 64):\n    try: os.write(n, b'\\xff' * 999)\n    except OSError: pass",
            Status.BROKE_CONTRACT,
            "pipe",
        ),
        ("import ctypes; ctypes.CDLL(None).syscall(0x40000000 + 39)", Status.KILLED, "SIGSYS"),  # the x32 interface
        ("import sys; sys.exit(0)", Status.FAILED_TO_LOAD, "SystemExit"),
        ("print(open('/etc/shadow').read())", Status.FAILED_TO_LOAD, "FileNotFoundError"),
        ("import socket; socket.socket()", Status.FAILED_TO_LOAD, "PermissionError"),
        ("open('/tmp/full', 'wb').write(bytes(17 << 20))", Status.FAILED_TO_LOAD, "File too large|No space left"),
    ],
)
def test_each_ends_with_a_reason_and_the_next_is_unaffected(
    attack: str, status: Status, said: str, pool: Pool, written: Written
) -> None:
    with pytest.raises(SubmissionError, match=said) as caught:
        pool.open(written(attack))
    assert caught.value.status is status
    with pool.open(written("", name="next.py")) as subject:
        subject.begin_control()
        assert subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0) == 1.0


def test_signals_that_are_ignored_do_not_help(pool: Pool, written: Written) -> None:
    text = """
import signal
for number in range(1, 65):
    try:
        signal.signal(number, signal.SIG_IGN)
    except (OSError, ValueError):
        pass
while True:
    pass
"""
    with pytest.raises(SubmissionError) as caught:
        pool.open(written(text), Limits(cpu_seconds=0.5))
    assert caught.value.status is Status.TIMED_OUT


def test_a_submission_that_is_killed_from_outside_is_graded_again(pool: Pool, written: Written) -> None:
    with pool.open(written("")) as subject:
        subject.begin_control()
        assert subject._cell is not None
        os.kill(process := subject._cell._process, signal.SIGKILL)
        wait_for(lambda: not Path(f"/proc/{process}").exists(), every=0.001)
        with pytest.raises(SandboxError, match="from outside"):  # and so is no zero
            subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0)
        subject.begin_control()  # and can be asked again
        assert subject.control(0.0, Reference(0.0, 0.0, 0.0), 0.0) == 1.0
