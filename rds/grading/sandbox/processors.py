"""Which processors grader and submission work on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from rds.grading.sandbox.shared_channel import can_be_used


@dataclass(frozen=True)
class Processors:
    """`own` is the grader's processors, `inner` the submission's. They are other ones if `apart`."""

    own: tuple[int, ...]
    inner: tuple[int, ...]

    @property
    def apart(self) -> bool:
        """Whether both can work at the same time, and so wait for each other by looking."""
        return not set(self.own) & set(self.inner) and can_be_used()

    @classmethod
    def of(cls, jobs: int, slot: int | None) -> Processors:
        """For job number `slot` of `jobs` at the same time; beside the processor that the grader is on if it is None.

        With two processors for each job, grader and submission have one each. With fewer they share one: they never
        work at the same time, and handing over within one processor is several times faster than between two.
        """
        usable = sorted(os.sched_getaffinity(0))
        is_wide = len(usable) >= 2 * jobs
        first = _here(usable) if slot is None else (2 * slot if is_wide else slot) % len(usable)
        second = (first + 1) % len(usable) if is_wide else first
        return cls((usable[first],), (usable[second],))


def _here(usable: list[int]) -> int:
    """Where in `usable` the processor is that this thread is on."""
    fields = Path("/proc/thread-self/stat").read_bytes().rpartition(b")")[2].split()
    number = int(fields[36])
    return usable.index(number) if number in usable else 0
