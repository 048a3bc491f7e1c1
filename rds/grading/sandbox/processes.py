"""What the processes of one cell use up, read in /proc from outside, where the cell cannot reach."""

from __future__ import annotations

import os
import re
from typing import NamedTuple

_TICK = 1.0 / os.sysconf("SC_CLK_TCK")
_HELD = re.compile(rb"^Vm(?:RSS|Swap):\s*(\d+) kB$", re.MULTILINE)


class ThreadTimes(NamedTuple):
    """What a thread has done so far, s; what is missing in the time that has gone by it was asleep."""

    computed: float
    waited: float  # for a processor


class Usage(NamedTuple):
    """Of all processes of a cell together."""

    cpu_seconds: float
    memory_bytes: int  # resident or swapped out; what processes share counts for each
    processes: int
    first_seconds: float  # computing time of the first of them, the one that answers
    first_runs: bool  # whether that one computes, or would if it had a processor
    first_thread: ThreadTimes | None  # of that one's first thread; None if this kernel does not tell
    first_sleeps: int  # how often that thread has gone to sleep by its own will


def usage(top: int, baseline: int = 0) -> Usage:
    """Of all processes below `top`, the cell's init, which is not counted itself; zeros once it has gone.

    `baseline` bytes of memory of each process are not counted; one that has less leaves nothing over for the others.

    Nothing can leave the tree: the orphans of a cell are adopted by its init. CPU time includes that of children that
    were waited for, so that work done by short-lived children adds up.
    """
    cpu, memory, count = _cpu(_fields(top), False, True), 0, 0
    waiting = _children(top)
    answering = waiting[0] if waiting else 0
    first = _fields(answering) if answering else []
    while waiting:
        process = waiting.pop()
        count += 1
        cpu += _cpu(_fields(process), True, True)
        memory += max(_resident(process) - baseline, 0)
        waiting += _children(process)
    turns, sleeps = (turns_of(answering), _sleeps(answering)) if answering else (None, 0)
    return Usage(cpu, memory, count, _cpu(first, True, False), first[:1] == [b"R"], turns, sleeps)


def turns_of(process: int, thread: int | None = None) -> ThreadTimes | None:
    """Of one of a process's threads (default: the first); None if this kernel does not tell, or it has gone."""
    fields = _read(f"/proc/{process}/task/{thread or process}/schedstat").split()
    return ThreadTimes(int(fields[0]) * 1e-9, int(fields[1]) * 1e-9) if len(fields) > 1 else None


def ended_for_memory() -> int:
    """How many processes the kernel has ended since it was started because there was no memory left."""
    found = re.search(rb"^oom_kill (\d+)$", _read("/proc/vmstat"), re.MULTILINE)
    return int(found[1]) if found else 0


def _sleeps(process: int) -> int:
    found = re.search(rb"^voluntary_ctxt_switches:\s*(\d+)$", _read(f"/proc/{process}/status"), re.MULTILINE)
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
    """In bytes, swapped out or not. A process whose first thread has ended seems to have none; its others tell."""
    found = _held(f"/proc/{process}/status")
    return found or max((_held(f"/proc/{process}/task/{thread}/status") for thread in _threads(process)), default=0)


def _held(path: str) -> int:
    return sum(int(kib) << 10 for kib in _HELD.findall(_read(path)))


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
