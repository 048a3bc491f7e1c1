"""What a submission has used up so far, in all its cells together."""

from __future__ import annotations

from dataclasses import dataclass, field

from rds.grading.grade import Status
from rds.grading.sandbox.limits import Limits
from rds.grading.sandbox.processes import ended_for_memory

FLOOD = 8  # times the limit of output: what one may print until it is ended
_LONGEST_STEP = 0.1  # s: a computer that stood still for longer is not the submission's doing


@dataclass
class Budget:
    """Times in s, sizes in bytes.

    Wall time runs only while the submission has to answer, and could: not while the grader works, nor while others have
    all processors. So a busy computer changes no verdict.
    """

    limits: Limits
    wall: float = 0.0
    cpu_before: float = 0.0  # of cells that have ended
    printed: int = 0  # bytes, those that were cut among them
    ended_for_memory: int = field(default_factory=ended_for_memory)  # on this computer, before it began

    def step(self, seconds: float) -> float:
        """`seconds` more of the submission's turn, less what it waited for a processor; how many of them count."""
        counted = min(max(seconds, 0.0), _LONGEST_STEP)
        self.wall += counted
        return counted

    def fault(self, cpu: float, memory: int, turn: float, turn_limit: float) -> tuple[Status, str] | None:
        """Which limit a cell exceeds that used `cpu` and `memory` and has had the turn for `turn` s; None if none."""
        limits = self.limits
        used = self.cpu_before + cpu
        if used > limits.cpu_seconds:
            return Status.TIMED_OUT, f"it took more than {limits.cpu_seconds:g} s of computing time in all"
        if turn > turn_limit:
            return (
                Status.TIMED_OUT,
                f"it gave no answer for {turn_limit:g} s; look for a loop without an end, or a wait",
            )
        if self.wall > limits.wall_seconds:
            return Status.TIMED_OUT, f"it took more than {limits.wall_seconds:g} s in all"
        if memory > limits.memory_bytes:
            most = limits.memory_bytes / 2**20
            return Status.KILLED, f"it took {memory / 2**20:.0f} MiB of memory; {most:.0f} MiB are allowed"
        return None
