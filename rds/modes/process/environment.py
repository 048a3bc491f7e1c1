"""The circumstances of a real-time run: a timing verdict is worth as much as what is known of them."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rds.core.scheduling import lock_memory, raise_priority, set_timer_slack, unlock_memory

TICK = 0.01  # s, in which the kernel counts what a hypervisor takes


def prepare(priority: int, cpu: int | None) -> dict[str, Any]:
    """Make this process as real-time as the system permits; returns what was got."""
    got: dict[str, Any] = {"scheduler": raise_priority(priority), "priority": priority}
    got["memory_locked"] = lock_memory()
    set_timer_slack()
    if cpu is not None:
        os.sched_setaffinity(0, {cpu})
    return got


@contextmanager
def prepared(priority: int, cpu: int | None) -> Iterator[dict[str, Any]]:
    """The same for a while, in a process that goes on to other work afterwards.

    Whatever that process, or one that it starts, computes later would otherwise keep the whole computer to itself.
    """
    if not hasattr(os, "sched_getscheduler"):
        yield prepare(priority, cpu)
        return
    scheduler, parameters, cpus = os.sched_getscheduler(0), os.sched_getparam(0), os.sched_getaffinity(0)
    try:
        yield prepare(priority, cpu)
    finally:
        os.sched_setscheduler(0, scheduler, parameters)
        os.sched_setaffinity(0, cpus)
        unlock_memory()
        set_timer_slack(0)  # back to the default


def describe_environment() -> dict[str, Any]:
    """What the system says of itself."""
    available = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    return {
        "cores": os.cpu_count(),
        "affinity": available,
        "governor": _first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
        "isolated_cores": _first_line("/sys/devices/system/cpu/isolated"),
        "preempt_rt": _first_line("/sys/kernel/realtime") == "1",
        "kernel": platform.release(),
        "system": platform.system(),
        "processor": platform.machine(),
        "virtual_machine": _virtual(),
        "python": platform.python_version(),
        "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "rt_runtime_us": _number("/proc/sys/kernel/sched_rt_runtime_us"),
        "rt_period_us": _number("/proc/sys/kernel/sched_rt_period_us"),
    }


def stolen_ticks() -> int | None:
    """Clock ticks that a hypervisor has taken from this machine so far; None where the kernel doesn't tell."""
    line = _first_line("/proc/stat")
    fields = line.split() if line else []
    return int(fields[8]) if len(fields) > 8 else None


def causes(environment: Mapping[str, Any], held: float) -> list[str]:
    """What the system is known to have done in a run that it held up for `held` seconds at most, at one time."""
    found = []
    if stops := environment.get("stops"):
        found.append(
            f"the process was stopped from outside {stops} time{'s' if stops > 1 else ''} (SIGSTOP, or a debugger)"
        )
    if faults := environment.get("page_faults"):
        found.append(f"the code waited for {faults} page{'s' if faults > 1 else ''} of memory from the disk")
    if stolen := environment.get("stolen_ticks"):
        found.append(f"the hypervisor took {stolen * TICK:.2f} s")
    if (throttled := throttling(environment)) and 0.7 * throttled <= held <= 1.5 * throttled:
        found.append(
            f"it held the loop up for about the {throttled * 1e3:.0f} ms of each second in which real-time throttling "
            "lets no real-time process run (/proc/sys/kernel/sched_rt_runtime_us; something with real-time priority "
            "keeps a processor busy: end it, or give it another one)"
        )
    return found


def throttling(environment: Mapping[str, Any]) -> float:
    """For how long in each period of the kernel's real-time throttling no real-time process runs, s; 0: never."""
    runtime, period = environment.get("rt_runtime_us"), environment.get("rt_period_us")
    if not str(environment.get("scheduler", "")).startswith("SCHED_FIFO") or runtime is None or not period:
        return 0.0
    return max(period - runtime, 0) / 1e6 if runtime >= 0 else 0.0


def sentence(environment: dict[str, Any]) -> str:
    """The environment of a verdict in one line."""
    parts = [str(environment.get("scheduler") or "scheduler unknown")]
    parts.append("memory locked" if environment.get("memory_locked") else "memory not locked")
    parts.append(f"governor {environment.get('governor') or 'unknown'}")
    parts.append(f"{environment.get('cores')} cores")
    if environment.get("virtual_machine"):
        parts.append("virtual machine")
    parts.append(f"{environment.get('system', sys.platform)} {environment.get('kernel', '')}".strip())
    return ", ".join(parts)


def _first_line(path: str) -> str | None:
    try:
        text = Path(path).read_text().strip()
    except OSError:
        return None
    return text.splitlines()[0] if text else None


def _number(path: str) -> int | None:
    line = _first_line(path)
    return int(line) if line and line.lstrip("-").isdigit() else None


def _virtual() -> bool | None:
    try:
        return " hypervisor " in Path("/proc/cpuinfo").read_text().replace("\n", " ")
    except OSError:
        return None
