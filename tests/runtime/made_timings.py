"""Times of runs made by hand, for verdicts."""

from __future__ import annotations

from typing import Any

import numpy as np

from rds.core.types import Verdict
from rds.modes.process.timing import Timing, judge

MS = 1_000_000
N = 1000


def ran(
    compute: Any = 0.05,
    waits: dict[int, float] | None = None,
    io: Any = 0.1,
    inside: dict[int, float] | None = None,
    taken: dict[int, float] | None = None,
    samples: int = N,
    discard: bool = False,
) -> tuple[Timing, dict[str, int]]:
    """What a loop of 1 ms records of a system that wakes it late (`waits`) or stalls it while it computes (`inside`).

    Times in ms; `taken` is what the scheduler takes while it computes, and says so.
    """
    waits, inside, taken = waits or {}, inside or {}, taken or {}
    compute, io = (np.broadcast_to(np.asarray(values, dtype=float), samples) for values in (compute, io))
    rows, free, k = [], 0.0, 0
    while k < samples:
        start = max(free, float(k)) + waits.get(k, 0.0)
        if discard and start - k >= 1.0:
            k = int(start)
            if k >= samples:
                break
        busy = float(compute[k]) + inside.get(k, 0.0) + taken.get(k, 0.0)
        rows.append((k, start - k, float(io[k]), 0.0, busy, 0.01, taken.get(k, 0.0)))
        free = start + float(io[k]) + busy + 0.01
        k += 1
    table = np.array(rows).T
    return Timing(table[0].astype(int), *(table[1:] * MS)), {"discarded": samples - len(rows)}


def verdict(*arguments: Any, **options: Any) -> Verdict:
    judging = {key: options.pop(key) for key in ("limit", "stalls", "threads", "again") if key in options}
    timing, counts = ran(*arguments, **options)
    return judge(timing, MS, **counts, **judging).verdict


def some(times: int, ms: float, of: int = N) -> np.ndarray:
    """Compute of `of` samples, `times` of which, evenly spread, take `ms`."""
    compute = np.full(of, 0.05)
    compute[5 :: of // times][:times] = ms
    return compute
