"""What the processes of one cell use up, read in /proc from outside, where the cell cannot reach."""

from __future__ import annotations

import os
import re
from typing import NamedTuple

_TICK = 1.0 / os.sysconf("SC_CLK_TCK")
_PAGE = os.sysconf("SC_PAGE_SIZE")


class Usage(NamedTuple):
    """Of all processes of a cell together."""

    cpu_seconds: float
    memory_bytes: int  # resident; what processes share counts for each
    processes: int
    first_seconds: float  # computing time of the first of them, the one that answers
    first_runs: bool  # whether that one computes, or would if it had a processor


def usage(top: int, baseline: int = 0) -> Usage:
    """Of all processes below `top`, the cell's init, which is not counted itself; zeros once it has gone.

    `baseline` bytes of memory of each process are not counted; one that has less leaves nothing over for the others.

    Nothing can leave the tree: the orphans of a cell are adopted by its init. CPU time includes that of children that
    were waited for, so that work done by short-lived children adds up.
    """
    cpu, memory, count = _cpu(_fields(top), False, True), 0, 0
    waiting = _children(top)
    first = _fields(waiting[0]) if waiting else []
    while waiting:
        process = waiting.pop()
        count += 1
        cpu += _cpu(_fields(process), True, True)
        memory += max(_resident(process) - baseline, 0)
        waiting += _children(process)
    return Usage(cpu, memory, count, _cpu(first, True, False), first[:1] == [b"R"])


def ended_for_memory() -> int:
    """How many processes the kernel has ended since it was started because there was no memory left."""
    found = re.search(rb"^oom_kill (\d+)$", _read("/proc/vmstat"), re.MULTILINE)
    return int(found[1]) if found else 0


def _children(process: int) -> list[int]:
    found: list[int] = []
    for thread in _threads(process):
        found += [int(word) for word in _read(f"/proc/{process}/task/{thread}/children").split()]
    return found


def _fields(process: int) -> list[bytes]:
    """Of its stat file, from the state on; none if it has ended."""
    return _read(f"/proc/{process}/stat").rpartition(b")")[2].split()  # the name before may hold anything


def _cpu(fields: list[bytes], own: bool, children: bool) -> float:
    if len(fields) < 15:
        return 0.0
    user, system, child_user, child_system = map(int, fields[11:15])
    return ((user + system) * own + (child_user + child_system) * children) * _TICK


def _resident(process: int) -> int:
    """In bytes. A process whose first thread has ended seems to have none; its other threads tell."""
    found = _pages(f"/proc/{process}/statm")
    if not found:
        found = max((_pages(f"/proc/{process}/task/{thread}/statm") for thread in _threads(process)), default=0)
    return found * _PAGE


def _pages(path: str) -> int:
    fields = _read(path).split()
    return int(fields[1]) if len(fields) > 1 else 0


def _threads(process: int) -> list[str]:
    try:
        return os.listdir(f"/proc/{process}/task")
    except OSError:
        return []


def _read(path: str) -> bytes:
    try:
        with open(path, "rb", buffering=0) as file:
            return file.read()
    except OSError:  # the process has just ended
        return b""
