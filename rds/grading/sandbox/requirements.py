"""Whether a sandbox that holds can be had on this computer: what is installed, and a trial of each wall."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from rds.core.extras import remedy
from rds.grading.sandbox.errors import SandboxError, SubmissionError
from rds.grading.sandbox.limits import Limits

if TYPE_CHECKING:
    from rds.grading.sandbox.interpreter import Interpreter

_TRIAL = Limits(cpu_seconds=20.0, memory_bytes=256 << 20, processes=4)
_NAMESPACES = (
    "unprivileged user namespaces may be switched off: `sysctl user.max_user_namespaces` must not be 0, on Ubuntu "
    "`sudo sysctl -w kernel.apparmor_restrict_unprivileged_userns=0`; a container must be allowed to make them"
)
_MASKED = (
    "parts of this container's /proc are masked, and then the kernel lets nobody mount one of their own: start it with "
    "`--security-opt systempaths=unconfined` (Docker) or `--security-opt unmask=ALL` (Podman)"
)
_ROOT = (
    "root gives submissions another user, for which a container needs `--cap-add=SYS_ADMIN`; or grade as another user, "
    "as in `--user 1000`"
)


@lru_cache
def available() -> str | None:
    """None if it holds here; else a sentence that says what is missing, and the command that mends it.

    The walls are tried, which takes about a second; the answer is kept for this process.
    """
    return missing() or _trial_fault()


def fault_of(interpreter: Callable[[], Interpreter]) -> str | None:
    """The same of an interpreter that goes on after the trial."""
    try:
        holes = _holes(interpreter())
    except SandboxError as error:
        return f"{error}; {_remedy(str(error))}"
    except SubmissionError as error:
        return f"the sandbox was tried, and did not work: {error.reason}"
    return f"the sandbox does not hold on this computer: {'; '.join(holes)}; use Linux 5.14 or newer" if holes else None


def missing() -> str | None:
    """What is not installed, with the command that installs it; None if nothing is missing."""
    if sys.platform != "linux":
        return (
            f"the sandbox is made of Linux's namespaces, and this is {sys.platform}; grade in a container "
            "(`rds grade run --container`), or on a Linux computer"
        )
    if shutil.which("bwrap") is None:
        return (
            "bubblewrap is missing, and submissions are run in nothing else; install it, as in "
            "`sudo apt install bubblewrap` or `sudo dnf install bubblewrap`"
        )
    try:
        import pyseccomp  # noqa: F401
    except (ImportError, RuntimeError, OSError):
        return (
            "pyseccomp or libseccomp is missing, without which a sandbox would leave holes; install them, as in "
            f"`{remedy('grading')}` and `sudo apt install libseccomp2`"
        )
    if not hasattr(os, "pidfd_open") or not Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").exists():
        return (
            "this kernel does not tell a process's children, so that limits cannot be enforced; use Linux 5.14 or newer"
        )
    return None


def _trial_fault() -> str | None:
    """Start a sandbox and try to break out of it."""
    from rds.grading.sandbox.interpreter import Interpreter
    from rds.grading.sandbox.user import sandbox_user

    try:
        interpreter = Interpreter(("numpy",), sandbox_user())
    except SandboxError as error:
        return f"{error}; {_remedy(str(error))}"
    try:
        return fault_of(lambda: interpreter)
    finally:
        interpreter.close()


def _remedy(said: str) -> str:
    """What to do about what bubblewrap or the warm interpreter said at its start."""
    if "execvp" in said:
        return "Python itself cannot be run there; use a Python that is installed whole, in a folder of its own"
    if "Error: " in said and "bwrap" not in said:  # Python's own last words
        return (
            "numpy and what it needs must be installed with pip or conda beside RDS, so that their files are known; "
            "try another environment, as in `python -m venv`"
        )
    if "mount proc" in said:
        return _MASKED
    if "unshare" in said and os.geteuid() == 0:
        return f"{_NAMESPACES}; {_ROOT}"
    return _NAMESPACES


def _holes(interpreter: Interpreter) -> list[str]:
    from rds.grading.sandbox.inside import probe
    from rds.grading.sandbox.loaded_submission import LoadedSubmission
    from rds.grading.sandbox.processors import Processors
    from rds.grading.sandbox.submission import Submission
    from rds.grading.sandbox.supervise import Supervisor

    supervisor = Supervisor()
    text = Submission("probe.py", Path(probe.__file__).read_bytes())  # installers make hard links, which are refused
    try:
        with LoadedSubmission(
            text, "functions", _TRIAL, lambda: interpreter, supervisor, Processors.of(1, None)
        ) as trial:
            user, process = trial.call("identity")
            tried = {
                "a submission would be root": user == 0,
                "it would see other processes": process > 2,
                "it could open a socket": trial.call("open_socket"),
                "it could make namespaces": trial.call("make_namespace"),
                "it could trace other processes": trial.call("trace_parent"),
                "it could write outside its own folder": trial.call("write_system") != [],
                # it counts itself, and for a moment also the process that began it: one less is no hole
                "the limit of processes does not count": trial.call("count_children", [12]) > _TRIAL.processes - 1,
                "the limit of memory does not count": trial.call("take_memory", [2 * _TRIAL.memory_bytes]),
                "the limit of computing time does not count": trial.call("cpu_limit") > 2 * _TRIAL.cpu_seconds,
            }
    finally:
        supervisor.close()
    return [hole for hole, is_open in tried.items() if is_open]
