"""Processes: waiting for the end of one, and whether one that was noted down is still the one that was meant."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
from pathlib import Path


def wait_for_end(process: subprocess.Popen[bytes], seconds: float) -> None:
    """Sleep until a process that was started here has ended, `seconds` at most."""
    if process.poll() is not None:
        return
    try:
        descriptor = os.pidfd_open(process.pid)
    except (AttributeError, OSError):  # not Linux, or one of before 2019
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(seconds)  # which looks again and again, in the end 20 times a second
        return
    try:
        ends = select.poll()
        ends.register(descriptor, select.POLLIN)
        ends.poll(seconds * 1e3)
    finally:
        os.close(descriptor)


def is_alive(process: int, argument: str) -> bool:
    """Whether the process runs and has `argument` in its command; without /proc, whether any of that number runs.

    Numbers of processes are used again.
    """
    try:
        return argument.encode() in Path(f"/proc/{process}/cmdline").read_bytes()
    except OSError:
        if Path("/proc").is_dir():
            return False
    try:
        os.kill(process, 0)
    except OSError:
        return False
    return True


def is_stopped(process: int) -> bool:
    """Whether it was stopped by a signal or a debugger, and does not run; false where that cannot be seen."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "Tt"
    except (OSError, IndexError):
        return False


def adopt_orphans() -> None:
    """Processes whose parent ends become children of this one, where the system has that (Linux)."""
    subreaper = 36  # PR_SET_CHILD_SUBREAPER, <linux/prctl.h>
    with contextlib.suppress(ImportError, OSError, AttributeError):
        import ctypes

        ctypes.CDLL(None).prctl(subreaper, 1, 0, 0, 0)


def end_group(leader: int) -> None:
    """End what a process that led a group of its own had started, and what that had."""
    with contextlib.suppress(OSError, AttributeError):
        os.killpg(leader, signal.SIGKILL)


def end_adopted() -> None:
    """End all children of this process, and what they leave to it: those that went into a group of their own."""
    for _ in range(100):
        try:
            children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
        except OSError:
            return
        if not children:
            return
        for child in map(int, children):
            with contextlib.suppress(OSError):
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)
