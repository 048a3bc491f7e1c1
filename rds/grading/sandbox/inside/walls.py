"""The walls around one submission, put up in a fresh fork of the warm interpreter before any of its code runs.

`enter` makes namespaces of the submission's own inside bubblewrap's: user, process numbers, mounts, System V objects.
`confine` is the last step, in the process that will run the submission: no capability, limits, and a filter that
leaves only the system calls that arithmetic needs.
"""

from __future__ import annotations

import os
import resource
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rds.grading.sandbox.inside import kernel

HOME = "/tmp"  # the only place that can be written to, and the only one that is different for each submission
_USER = 1000  # its number inside; which one that is outside is bubblewrap's affair
_FILES = 64  # open at once
_INODES = 256  # files in HOME


def go_first() -> None:
    """Where a computer has no memory left, the kernel ends this process and its children before all others."""
    Path("/proc/self/oom_score_adj").write_text("1000")


def enter(tmp_bytes: int) -> None:
    """Namespaces of its own for the children of this process; an empty HOME of `tmp_bytes`, and no /proc."""
    outer_user, outer_group = os.getuid(), os.getgid()
    kernel.unshare(kernel.CLONE_NEWUSER | kernel.CLONE_NEWNS | kernel.CLONE_NEWPID | kernel.CLONE_NEWIPC)
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"{_USER} {outer_user} 1")
    Path("/proc/self/gid_map").write_text(f"{_USER} {outer_group} 1")
    flags = kernel.MS_NOSUID | kernel.MS_NODEV | kernel.MS_NOEXEC
    kernel.mount("tmpfs", HOME, "tmpfs", flags, f"size={tmp_bytes},nr_inodes={_INODES},mode=700")
    kernel.mount("tmpfs", "/proc", "tmpfs", flags | kernel.MS_RDONLY, "size=4096,nr_inodes=1,mode=555")
    os.chdir(HOME)


def confine(limits: Mapping[str, Any], baseline_bytes: int, calls: bytes, cpus: list[int]) -> None:
    """`limits` as of `rds.grading.sandbox.limits`; `baseline_bytes` of address space were there before the submission.

    `calls` is the filter of system calls, `cpus` are those that it may run on (all where the list is empty).
    """
    if cpus:
        os.sched_setaffinity(0, cpus)
    kernel.limit(resource.RLIMIT_AS, baseline_bytes + int(limits["memory_bytes"]))
    # the supervisor, which sums, comes first; the hard limit kills without a word, the soft one says which limit it is
    kernel.limit(resource.RLIMIT_CPU, int(limits["cpu_seconds"]) + 2, beyond=1)
    kernel.limit(resource.RLIMIT_NPROC, int(limits["processes"]) + 1)  # and the init above it
    kernel.limit(resource.RLIMIT_FSIZE, int(limits["file_bytes"]))
    kernel.limit(resource.RLIMIT_NOFILE, _FILES)
    for none in (resource.RLIMIT_CORE, resource.RLIMIT_MEMLOCK, resource.RLIMIT_MSGQUEUE, resource.RLIMIT_RTPRIO):
        kernel.limit(none, 0)
    kernel.drop_capabilities()
    kernel.filter_calls(calls)
