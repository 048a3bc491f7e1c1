"""What a submission may use up."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """For one submission, in all its cases together where nothing else is said."""

    cpu_seconds: float = 30.0
    wall_seconds: float = 60.0
    call_seconds: float = 2.0  # wall time of one answer
    load_seconds: float = 10.0  # wall time of loading the file
    memory_bytes: int = 1 << 30  # of all its processes together
    processes: int = 8  # and threads
    output_bytes: int = 1 << 20  # of stdout and stderr together; what is more is cut, and a flood is killed
    file_bytes: int = 16 << 20  # of its private /tmp in all
