"""What a process may ask of the system to be on time. Every helper is harmless where it isn't supported."""

from __future__ import annotations

import os
import sys


def raise_priority(level: int) -> str:
    """Schedule this process first-in-first-out at `level` (1 lowest to 99); say what was got.

    Returns "SCHED_FIFO 70", or "normal: " and the reason, e.g. "normal: not permitted".
    Threads started afterwards inherit it, and so do child processes.
    """
    if not hasattr(os, "sched_setscheduler"):
        return "normal: not supported here"
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(level))
    except PermissionError:
        return "normal: not permitted"
    except OSError as error:
        return f"normal: {error.strerror}"
    return f"SCHED_FIFO {level}"


def lock_memory() -> bool:
    """Keep the pages of this process in memory (mlockall); true if that was permitted.

    Future pages are locked too, unless a limit on locked memory would then let a later allocation fail.
    """
    if not sys.platform.startswith("linux"):
        return False
    current, future = 1, 2  # MCL_CURRENT, MCL_FUTURE, <sys/mman.h>
    try:
        import ctypes
        import resource

        unlimited = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY
        what = current | future if unlimited or os.geteuid() == 0 else current
        return bool(ctypes.CDLL(None, use_errno=True).mlockall(what) == 0)
    except (ImportError, OSError, AttributeError):
        return False


def unlock_memory() -> None:
    """Undo `lock_memory`."""
    if not sys.platform.startswith("linux"):
        return
    try:
        import ctypes

        ctypes.CDLL(None).munlockall()
    except (ImportError, OSError, AttributeError):
        return


def set_timer_slack(nanoseconds: int = 1) -> bool:
    """Let sleeps of this thread end at most `nanoseconds` late by the kernel's choice (0: its default, 50 µs).

    Returns true if it was set. Without effect under SCHED_FIFO, whose sleeps have no slack.
    """
    if not sys.platform.startswith("linux"):
        return False
    set_slack = 29  # PR_SET_TIMERSLACK, <sys/prctl.h>
    try:
        import ctypes

        return bool(ctypes.CDLL(None, use_errno=True).prctl(set_slack, ctypes.c_ulong(nanoseconds), 0, 0, 0) == 0)
    except (ImportError, OSError, AttributeError):
        return False


def end_with_parent() -> bool:
    """Let the kernel kill this process when the one that started it dies; true if that was arranged."""
    if not sys.platform.startswith("linux"):
        return False
    set_death_signal, kill = 1, 9  # PR_SET_PDEATHSIG, <sys/prctl.h>; SIGKILL
    try:
        import ctypes

        return bool(ctypes.CDLL(None, use_errno=True).prctl(set_death_signal, ctypes.c_ulong(kill), 0, 0, 0) == 0)
    except (ImportError, OSError, AttributeError):
        return False
