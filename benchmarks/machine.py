"""What the numbers were measured on, and with."""

from __future__ import annotations

import contextlib
import os
import platform
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from benchmarks import c_program, cyclictest, nc_peers
from rds.modes.process.environment import describe_environment

PACKAGES = ("mini-cnc-rds", "numpy", "numba", "llvmlite", "scipy", "control", "bdsim", "python-can", "canopen")


def versions() -> dict[str, str]:
    """Of everything that takes part and is there."""
    found = {"Python": f"{platform.python_implementation()} {platform.python_version()}"}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    with contextlib.suppress(OSError):
        found["C"] = c_program.version()
    with contextlib.suppress(OSError):
        found["cyclictest"] = cyclictest.version()
    if (linuxcnc := nc_peers.rs274_version()) is not None:
        found["rs274 (linuxcnc-uspace)"] = linuxcnc
    return found


def machine() -> dict[str, Any]:
    """Processor, kernel, scheduler's circumstances, memory."""
    return {"processor_model": _field("/proc/cpuinfo", "model name"), **describe_environment()} | {
        "memory": _field("/proc/meminfo", "MemTotal"),
        "clock_source": _text("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
    }


def load() -> float | None:
    """The load average of the last minute."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def rivals(priority: int = 80) -> int | None:
    """How many other processes have a real-time priority of at least our loop's; None where that can't be seen."""
    if not hasattr(os, "sched_getparam"):
        return None
    count = 0
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # it may have ended meanwhile
            of_the_kernel = not (folder / "cmdline").read_bytes()
            count += not of_the_kernel and os.sched_getparam(int(folder.name)).sched_priority >= priority
    return count


def wait_for_quiet(most: float, patience: float) -> float | None:
    """Wait until the load average is at most `most`, for at most `patience` s; returns it."""
    end = time.monotonic() + patience
    while (now := load()) is not None and now > most and time.monotonic() < end:
        time.sleep(1.0)
    return now


def _field(path: str, name: str) -> str | None:
    for line in (_text(path) or "").splitlines():
        key, _, value = line.partition(":")
        if key.strip() == name:
            return value.strip()
    return None


def _text(path: str) -> str | None:
    try:
        return Path(path).read_text().strip()
    except OSError:
        return None
