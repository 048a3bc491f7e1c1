"""Whether a process that was noted down is still the one that was meant: numbers of processes are used again."""

from __future__ import annotations

import os
from pathlib import Path


def is_alive(process: int, argument: str) -> bool:
    """Whether the process runs and has `argument` in its command; without /proc, whether any of that number runs."""
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
