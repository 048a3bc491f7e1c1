"""Which processors grader and submission work on."""

from __future__ import annotations

import os
from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """The processors `cpus`, for grader and submission together; wherever there is room if empty."""

    cpus: tuple[int, ...] = ()

    @classmethod
    def of(cls, jobs: int, slot: int | None) -> Place:
        """With fewer than two processors for each job, grader and submission take turns on one.

        They never work at the same time, and handing over within one processor is several times faster. `slot` tells
        the jobs apart.
        """
        usable = sorted(os.sched_getaffinity(0))
        if slot is None:
            return cls()
        return cls((usable[slot % len(usable)],))
